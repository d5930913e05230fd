"""Color profiles: encoded values of a profiled photo to linear light of the sRGB primaries."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.formats.photos.raster import Values
from texproj.photo import srgb_from_linear

Floats = NDArray[np.float32]

SRGB_PRIMARIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06)
ADOBE_RGB_PRIMARIES = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06)
ADOBE_RGB_GAMMA = 563 / 256
D65 = (0.3127, 0.3290)

SPACES = {b"RGB ": ("rgb", 3), b"GRAY": ("gray", 1), b"CMYK": ("cmyk", 4)}
"""Signature in a profile's bytes 16..19: the name lcms knows, and the number of channels."""

SRGB_TOLERANCE = 1.5 / 255
"""sRGB profiles of different makers differ by rounding: up to one 8-bit step and a half."""

MATRIX_TOLERANCE = 2e-4
"""Linear light; curves and matrices in profiles have 16 bits."""


@lru_cache(maxsize=16)
def usable(profile: bytes, channels: int) -> bool:
    """Whether the color engine takes this profile for photos of so many channels."""
    import imagecodecs  # noqa: PLC0415

    if SPACES.get(profile[16:20], ("", 0))[1] != channels:
        return False
    try:
        _transform(np.zeros((1, channels), np.float32), profile)
    except (imagecodecs.CmsError, ValueError):
        return False
    return True


@lru_cache(maxsize=16)
def is_srgb(profile: bytes) -> bool:
    """Whether a usable profile means sRGB, judged by what it does to a grid of colors."""
    channels = SPACES[profile[16:20]][1]
    if channels == 4:
        return False
    axes = np.meshgrid(*[np.linspace(0, 1, 9, dtype=np.float32)] * channels)
    encoded = np.stack([axis.ravel() for axis in axes], axis=1)
    back = srgb_from_linear(_transform(encoded, profile))
    return bool(np.abs(back - encoded).max() <= SRGB_TOLERANCE)


@lru_cache(maxsize=1)
def adobe_rgb() -> bytes:
    """A profile for files that only say by EXIF that they are Adobe RGB (1998)."""
    import imagecodecs  # noqa: PLC0415

    return imagecodecs.cms_profile(
        "rgb", whitepoint=D65, primaries=ADOBE_RGB_PRIMARIES, gamma=ADOBE_RGB_GAMMA
    )


def linear_from_profile(values: Values, profile: bytes) -> Floats:
    """(h, w, c) encoded values to (h, w, 3) linear light, 1 = white, colors outside of sRGB kept.

    c = 1, 3 or 4 (CMYK, full value = full ink) as `usable` has it; relative colorimetric.
    """
    levels = {np.dtype(np.uint8): 256, np.dtype(np.uint16): 65536}.get(values.dtype)
    if levels and values.shape[2] == 1:
        return _gray_table(profile, levels)[values[..., 0]]
    if levels and values.shape[2] == 3:
        tables, matrix, exact = _matrix_form(profile, levels)
        if exact:
            return cv2.transform(_looked_up(values, tables), matrix)
    return _transform(values, profile)


@lru_cache(maxsize=4)
def _gray_table(profile: bytes, levels: int) -> Floats:
    ramp = np.linspace(0, 1, levels, dtype=np.float32)[:, None]
    return _transform(ramp, profile)


@lru_cache(maxsize=4)
def _matrix_form(profile: bytes, levels: int) -> tuple[Floats, Floats, bool]:
    """((levels, 3) curves, (3, 3) matrix to linear sRGB, whether these are the whole profile).

    Ours: most RGB profiles are three curves and a matrix; found from the images of the three
    axes, and believed if they predict a grid of other colors. 20 times faster than the engine.
    """
    ramp = np.linspace(0, 1, levels, dtype=np.float32)
    axes = [_transform(ramp[:, None] * np.eye(3, dtype=np.float32)[k], profile) for k in range(3)]
    matrix = np.stack([axis[-1] for axis in axes], axis=1)
    curves = [axis @ axis[-1] / (axis[-1] @ axis[-1]) for axis in axes]
    tables = np.stack(curves, axis=1).astype(np.float32)
    steps = np.linspace(0, levels - 1, 6).astype(int)
    index = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    guess = np.take_along_axis(tables, index, axis=0) @ matrix.T
    exact = np.abs(guess - _transform(ramp[index], profile)).max() < MATRIX_TOLERANCE
    return tables, matrix, bool(exact)


def _looked_up(values: Values, tables: Floats) -> Floats:
    if values.dtype == np.uint8:
        return cv2.LUT(values, tables[None])
    return np.stack([np.take(tables[:, k], values[..., k]) for k in range(3)], axis=-1)


def _transform(values: Values, profile: bytes) -> Floats:
    """(..., c) values of any type through the color engine, in floating point."""
    import imagecodecs  # noqa: PLC0415

    linear_srgb = imagecodecs.cms_profile(
        "rgb", whitepoint=D65, primaries=SRGB_PRIMARIES, gamma=1.0
    )
    space, channels = SPACES[profile[16:20]]
    rows = np.ascontiguousarray(values).reshape(1, -1, channels)
    if channels == 1:
        rows = rows[..., 0]
    out = imagecodecs.cms_transform(
        rows, profile, linear_srgb,
        colorspace=space, outcolorspace="rgb", outdtype=np.float32,
    )  # fmt: skip
    return out.reshape(*values.shape[:-1], 3)
