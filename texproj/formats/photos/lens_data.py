"""What is known of lenses: the distortion and the loss of light towards the corners that lensfun's
database has for the one that EXIF names.

lensfun's models speak of radii in units of the picture's half height; they are read through its own
mapping of pixels and of light. Distortion is fitted by OpenCV's k1 k2 k3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from texproj.arrays import Doubles
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.photos.exif import F_NUMBER, FOCAL_MM, MAKE, MODEL, Described, number_of

LENS_MAKE, LENS_MODEL = 0xA433, 0xA434
LEAST_SCORE = 50
"""Of lensfun's comparison of names: lenses that it finds for half a name, or by the camera alone,
have less than 40, the right ones 51 to 85."""
LONG_SIDE_PX, INNERMOST = 240, 0.15
"""Size of the picture that lensfun is asked about, and of its radii the part that is left out in
the middle, where rounding is all."""
FAR_M = 1000.0
"""Distance that is asked for: the database knows distortion at few others."""
USUAL_F_NUMBER = 8.0
"""For distortion, which does not depend on it."""
MOST_LIGHT_ERROR, LEAST_LIGHT = 0.01, 0.05
"""Part of the light that three terms may miss; what is darker in a corner has no picture there."""
MOST_ERROR = 0.002
"""Of the radius: what OpenCV's terms cannot follow better is no start."""


Names = tuple[tuple[str, str], tuple[str, str]]
"""Maker and model of the camera, and of the lens."""


@dataclass(frozen=True)
class KnownLens:
    """What the database has of a lens. name: empty where it has nothing; distortion: k1 k2 p1 p2 k3
    at the focal length; lens_light: (3,) k of 1 + k1 r^2 + k2 r^4 + k3 r^6, r in half diagonals:
    the light at this focal length and aperture over that in the middle. Each may be empty.
    """

    name: str = ""
    distortion: tuple[float, ...] = ()
    lens_light: tuple[float, ...] = ()


def known_lens(header: Described, focal_px: float | None) -> KnownLens:
    """What is known of the photo's lens; nothing where EXIF does not name camera and lens, or
    lensfun does not know them.
    """
    make, model = (str(header.tags.get(tag) or "").strip(" \0") for tag in (MAKE, MODEL))
    maker, lens = (str(header.exif.get(t) or "").strip(" \0") for t in (LENS_MAKE, LENS_MODEL))
    focal_mm = number_of(header.exif, FOCAL_MM)
    if not (make and model and lens and focal_mm and focal_px):
        return KnownLens()
    aspect = max(header.width, header.height) / max(min(header.width, header.height), 1)
    f_number = number_of(header.exif, F_NUMBER)
    relative = focal_px / max(header.width, header.height)
    shape = (round(aspect, 3), relative)
    return _known(((make, model), (maker, lens)), focal_mm, f_number, shape)


@lru_cache(maxsize=64)
def _known(
    names: Names, focal_mm: float, f_number: float | None, shape: tuple[float, float]
) -> KnownLens:
    """shape: longer over shorter side, and focal length over the longer side."""
    try:
        with foreign_parser():
            found = _looked_up(names, focal_mm)
            if found is None:
                return KnownLens()
            lens, crop = found
            size = LONG_SIDE_PX, round(LONG_SIDE_PX / shape[0])
            distortion = _distortion(
                lens, crop, (focal_mm, f_number or USUAL_F_NUMBER), size, shape[1]
            )
            light = _lens_light(lens, crop, (focal_mm, f_number), size) if f_number else ()
    except Broken:
        return KnownLens()
    return KnownLens(lens.model if distortion or light else "", distortion, light)


@lru_cache(maxsize=1)
def _database() -> Any:
    import lensfunpy  # noqa: PLC0415 - a third of a second, only where EXIF names a lens

    return lensfunpy.Database()


def _looked_up(names: Names, focal_mm: float) -> tuple[Any, float] | None:
    """The lens and the camera's crop factor; None where there is none that is surely it."""
    import lensfunpy  # noqa: PLC0415

    camera, lens = names
    bodies = _database().find_cameras(*camera)
    found = _database().find_lenses(bodies[0], lens[0] or None, lens[1]) if bodies else []
    wide = [one for one in found if one.min_focal <= focal_mm * 1.02 <= one.max_focal * 1.05]
    if not wide or wide[0].score < LEAST_SCORE or wide[0].type != lensfunpy.LensType.RECTILINEAR:
        return None
    return wide[0], bodies[0].crop_factor


def _distortion(
    lens: Any, crop: float, set_to: tuple[float, float], size: tuple[int, int], relative: float
) -> tuple[float, ...]:
    import lensfunpy  # noqa: PLC0415

    modifier = lensfunpy.Modifier(lens, crop, *size)
    modifier.initialize(*set_to, FAR_M, flags=lensfunpy.ModifyFlags.DISTORTION)
    bent = modifier.apply_geometry_distortion(0, 0, *size)
    if bent is None:
        return ()
    middle = np.array(size) / 2
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    straight_px = np.hypot(x - middle[0], y - middle[1]).ravel()
    bent_px = np.linalg.norm(bent.reshape(-1, 2) - middle, axis=1)
    return _fitted(straight_px, bent_px, relative * LONG_SIDE_PX)


def _lens_light(
    lens: Any, crop: float, set_to: tuple[float, float], size: tuple[int, int]
) -> tuple[float, ...]:
    """Of what lensfun multiplies a white picture by; nothing where it does not know, and where
    there is more light outwards.
    """
    import lensfunpy  # noqa: PLC0415

    modifier = lensfunpy.Modifier(lens, crop, *size)
    modifier.initialize(
        *set_to, FAR_M, pixel_format=np.float32, flags=lensfunpy.ModifyFlags.VIGNETTING
    )
    white = np.ones((size[1], size[0], 3), np.float32)
    if not modifier.apply_color_modification(white):
        return ()
    x, y = (np.arange(side) - (side - 1) / 2 for side in size)
    r2 = (x**2 + y[:, None] ** 2).ravel() / (x[0] ** 2 + y[0] ** 2)  # its corner pixel has r = 1
    told = 1 / np.maximum(white[..., 1].ravel(), 1e-6) - 1
    system = np.stack([r2, r2**2, r2**3], axis=1)
    terms = np.linalg.lstsq(system, told, rcond=None)[0]
    error = np.abs(system @ terms - told).max()
    falls = told.min() > LEAST_LIGHT - 1 and told.max() < MOST_LIGHT_ERROR
    return tuple(terms.tolist()) if falls and error < MOST_LIGHT_ERROR else ()


def _fitted(straight_px: Doubles, bent_px: Doubles, focal_px: float) -> tuple[float, ...]:
    """k1 k2 0 0 k3 of where radii are seen; nothing where these terms cannot follow."""
    far = straight_px > INNERMOST * straight_px.max()
    ratio, r = bent_px[far] / straight_px[far], straight_px[far] / focal_px
    system = np.stack([np.ones_like(r), r**2, r**4, r**6], axis=1)
    scale, a, b, c = np.linalg.lstsq(system, ratio, rcond=None)[0]
    error = np.abs(system @ [scale, a, b, c] - ratio).max()
    if not (error < MOST_ERROR and 0.8 < scale < 1.25) or max(abs(a), abs(b), abs(c)) > 1:
        return ()
    return tuple(float(v) for v in (a / scale, b / scale, 0, 0, c / scale))
