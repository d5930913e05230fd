"""OpenEXR: linear light in half or single precision, by the format's own library.

The photo is the display window; where the data window leaves some of it out, pixels are never used.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from texproj.formats.foreign import Broken
from texproj.formats.photos.exif import (
    EXPOSURE_TIME,
    F_NUMBER,
    FOCAL_MM,
    ISO,
    MAKE,
    MODEL,
    PLANE_UNIT,
    PLANE_X_RESOLUTION,
    SERIAL,
)
from texproj.formats.photos.icc import D65, SRGB_PRIMARIES
from texproj.formats.photos.raster import Raster, Stored, Tags

Part = Any
"""A part of an OpenEXR.File."""

MICROMETRE = 5
"""EXIF FocalPlaneResolutionUnit."""
TAGS = {"cameraMake": MAKE, "cameraModel": MODEL}
EXIF = {
    "expTime": EXPOSURE_TIME, "aperture": F_NUMBER, "isoSpeed": ISO,
    "nominalFocalLength": FOCAL_MM, "cameraSerialNumber": SERIAL,
}  # fmt: skip
"""OpenEXR's standard attributes and EXIF's numbers for them."""
PITCH = "sensorPhotositePitch"
SAME_COLORS = 1e-4
"""By how much chromaticities that mean sRGB's differ: they are single precision."""
SUBSAMPLED = "its channels have different resolutions: save it as RGB"


def exr_stored(file: io.BufferedIOBase) -> Stored:
    """What the header tells."""
    part = _part(file, header_only=True)
    header = part.header
    _, size = _window(header["displayWindow"])
    names = [str(channel.name) for channel in header["channels"]]
    channels = len(_picked(names)[0])
    exif = {tag: header[name] for name, tag in EXIF.items() if name in header}
    if header.get(PITCH):
        exif |= {PLANE_X_RESOLUTION: 1 / float(header[PITCH]), PLANE_UNIT: MICROMETRE}
    notes: tuple[str, ...] = ()
    if abs(float(header.get("pixelAspectRatio", 1.0)) - 1) > SAME_COLORS:
        notes = ("its pixels are not square, which is ignored",)
    tags: Tags = {tag: header[name] for name, tag in TAGS.items() if name in header}
    return Stored("OpenEXR", *size, channels, _profile(header, channels), tags, exif, notes)


def exr_raster(data: bytes) -> Raster:
    """Pixels of the first part, float32 linear, colors not multiplied by alpha."""
    part = _part(io.BytesIO(data), header_only=False)
    given = {str(name): channel.pixels for name, channel in part.channels.items()}
    colors, alpha = _picked(list(given))
    planes = [given[name] for name in (*colors, *([alpha] if alpha else []))]
    start, size = _window(part.header["displayWindow"])
    corner, held = _window(part.header["dataWindow"])
    if any(plane is None or plane.shape != held[::-1] for plane in planes):
        raise Broken(SUBSAMPLED)
    values = np.stack([plane.astype(np.float32) for plane in planes], axis=-1)
    shift = corner[0] - start[0], corner[1] - start[1]
    if alpha is None and (any(shift) or held != size):
        values = np.dstack([values, np.ones(values.shape[:2], np.float32)])
    if shift != (0, 0) or held != size:
        values = _placed(values, shift, size)
    if values.shape[2] == len(colors):
        return Raster(values)
    return _straight(values[..., :-1], values[..., -1])


def _straight(colors: Any, alpha: Any) -> Raster:
    """Colors divided by their alpha, with which OpenEXR has them multiplied."""
    partly = (alpha > 0) & (alpha < 1)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        straight = np.where(partly[..., None], colors / alpha[..., None], colors)
    return Raster(straight, np.ascontiguousarray(alpha))


def _placed(values: Any, shift: tuple[int, int], size: tuple[int, int]) -> Any:
    """The data window's pixels in the display window, zero beside them."""
    whole = np.zeros((size[1], size[0], values.shape[2]), np.float32)
    (dx, dy), (height, width) = shift, values.shape[:2]
    x0, y0, x1, y1 = max(dx, 0), max(dy, 0), min(dx + width, size[0]), min(dy + height, size[1])
    if x0 < x1 and y0 < y1:
        whole[y0:y1, x0:x1] = values[y0 - dy : y1 - dy, x0 - dx : x1 - dx]
    return whole


def _part(file: io.BufferedIOBase, header_only: bool) -> Part:
    import OpenEXR  # noqa: PLC0415

    file.seek(0)
    with contextlib.redirect_stdout(io.StringIO()):  # it tells of broken files there
        parts = OpenEXR.File(file, separate_channels=True, header_only=header_only).parts
    if not parts or "channels" not in parts[0].header:
        raise Broken("no picture in it")
    return parts[0]


def _window(box: Any) -> tuple[tuple[int, int], tuple[int, int]]:
    """First corner, and width and height, of an inclusive box of pixels."""
    (x0, y0), (x1, y1) = ([int(v) for v in corner] for corner in box)
    if x1 < x0 or y1 < y0:
        raise Broken("no size in it")
    return (x0, y0), (x1 - x0 + 1, y1 - y0 + 1)


def _picked(names: list[str]) -> tuple[list[str], str | None]:
    """The channels of the colors, and of alpha: those without a layer, or of the first layer."""
    layers = sorted({name.rpartition(".")[0] for name in names})
    for layer in layers:
        start = f"{layer}." if layer else ""
        for colors in (["R", "G", "B"], ["Y"]):
            if all(start + color in names for color in colors):
                alpha = f"{start}A" if f"{start}A" in names else None
                return [start + color for color in colors], alpha
    raise Broken(f"no channels R, G, B or Y in it but {', '.join(names)[:60]}")


def _profile(header: Mapping[str, Any], channels: int) -> bytes | None:
    """An ICC profile for other primaries than sRGB's, None for these."""
    import imagecodecs  # noqa: PLC0415

    told = header.get("chromaticities")
    if told is None or channels != 3:
        return None
    told = [float(value) for value in told]
    if np.abs(np.subtract(told, (*SRGB_PRIMARIES, *D65))).max() < SAME_COLORS:
        return None
    return imagecodecs.cms_profile("rgb", whitepoint=told[6:], primaries=told[:6], gamma=1.0)
