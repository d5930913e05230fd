"""What is known of lenses: the distortion that lensfun's database has for the one that EXIF names.

lensfun's models speak of radii in units of the picture's half height; they are read through its own
mapping of pixels and fitted by OpenCV's k1 k2 k3.
"""

from __future__ import annotations

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
MOST_ERROR = 0.002
"""Of the radius: what OpenCV's terms cannot follow better is no start."""


def known_distortion(header: Described, focal_px: float | None) -> tuple[tuple[float, ...], str]:
    """k1 k2 p1 p2 k3 of the photo's lens at its focal length, and the lens's name; nothing where
    EXIF does not name camera and lens, or lensfun does not know them.
    """
    make, model = (str(header.tags.get(tag) or "").strip(" \0") for tag in (MAKE, MODEL))
    maker, lens = (str(header.exif.get(t) or "").strip(" \0") for t in (LENS_MAKE, LENS_MODEL))
    focal_mm = number_of(header.exif, FOCAL_MM)
    if not (make and model and lens and focal_mm and focal_px):
        return (), ""
    aspect = max(header.width, header.height) / max(min(header.width, header.height), 1)
    f_number = number_of(header.exif, F_NUMBER) or 8.0
    relative = focal_px / max(header.width, header.height)
    return _known((make, model), (maker, lens), focal_mm, f_number, (round(aspect, 3), relative))


@lru_cache(maxsize=64)
def _known(
    camera: tuple[str, str], lens: tuple[str, str], focal_mm: float, f_number: float,
    shape: tuple[float, float],
) -> tuple[tuple[float, ...], str]:  # fmt: skip
    """shape: longer over shorter side, and focal length over the longer side."""
    try:
        with foreign_parser():
            return _looked_up(camera, lens, focal_mm, f_number, shape)
    except Broken:
        return (), ""


@lru_cache(maxsize=1)
def _database() -> Any:
    import lensfunpy  # noqa: PLC0415 - a third of a second, only where EXIF names a lens

    return lensfunpy.Database()


def _looked_up(
    camera: tuple[str, str], lens: tuple[str, str], focal_mm: float, f_number: float,
    shape: tuple[float, float],
) -> tuple[tuple[float, ...], str]:  # fmt: skip
    import lensfunpy  # noqa: PLC0415

    bodies = _database().find_cameras(*camera)
    found = _database().find_lenses(bodies[0], lens[0] or None, lens[1]) if bodies else []
    wide = [one for one in found if one.min_focal <= focal_mm * 1.02 <= one.max_focal * 1.05]
    if not wide or wide[0].score < LEAST_SCORE or wide[0].type != lensfunpy.LensType.RECTILINEAR:
        return (), ""
    width, height = LONG_SIDE_PX, round(LONG_SIDE_PX / shape[0])
    modifier = lensfunpy.Modifier(wide[0], bodies[0].crop_factor, width, height)
    modifier.initialize(focal_mm, f_number, FAR_M, flags=lensfunpy.ModifyFlags.DISTORTION)
    bent = modifier.apply_geometry_distortion(0, 0, width, height)
    if bent is None:
        return (), ""
    middle = np.array([width, height]) / 2
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    straight_px = np.hypot(x - middle[0], y - middle[1]).ravel()
    bent_px = np.linalg.norm(bent.reshape(-1, 2) - middle, axis=1)
    return _fitted(straight_px, bent_px, shape[1] * LONG_SIDE_PX), wide[0].model


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
