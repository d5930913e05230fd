"""Masks painted on photos: each stroke changes the file in masks/, and what was there before it is
kept in work/, so that every step can be taken back.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.errors import OutputError, UsageError
from texproj.files import content_hash, write_atomically
from texproj.project import MASKS_FOLDER, Project

Mask = NDArray[np.uint8]

NEVER, USED = 0, 255
"""Values of a mask that is painted here; any but 0 is used."""

MOST_KEPT = 30
"""Steps that can be taken back; the file as it was before the first one is kept besides."""

SUFFIX = ".png"
DIGITS = 6
"""Of the number of what is kept."""

NO_MASK = ".none"
"""Ending of what is kept in place of a mask that was not there."""


@dataclass(frozen=True)
class Stroke:
    """What is done to a mask.

    kind: paint = never use what lies under the line, erase = use it again, grow = make what is not
    used wider by `radius_px` on all sides (less than 0: narrower), clear = use everything;
    points_px: corners of the line, upright full-size pixels; radius_px: half its width.
    """

    kind: Literal["paint", "erase", "grow", "clear"]
    radius_px: float = 0.0
    points_px: tuple[tuple[float, float], ...] = ()


def mask_version(project: Project, name: str) -> str:
    """Another word for another mask file. Raises InputError where a photo has two."""
    path = project.mask_path(name)
    return "none" if path is None else content_hash(path.read_bytes())


def mask_of(project: Project, name: str) -> Mask:
    """(h, w) uint8 mask of the full-size photo, its own transparency in it. Raises InputError."""
    photo = project.load_photo(name)
    if photo.mask is not None:
        return photo.mask.copy()
    return np.full((photo.height, photo.width), USED, np.uint8)


def stroked(mask: Mask, stroke: Stroke) -> Mask:
    """The mask after a stroke."""
    out = mask.copy()
    if stroke.kind == "clear":
        out[:] = USED
    elif stroke.kind == "grow":
        never = mask == NEVER
        wide = stroke.radius_px > 0
        kept = _wider(never, stroke.radius_px) if wide else ~_wider(~never, -stroke.radius_px)
        out[kept & ~never] = NEVER
        out[never & ~kept] = USED
    else:
        value = NEVER if stroke.kind == "paint" else USED
        _draw(out, stroke, value)
    return out


def _wider(region: NDArray[np.bool_], radius_px: float) -> NDArray[np.bool_]:
    """(h, w) the region and all within a distance of it."""
    if not region.any():
        return region
    outside = (~region).astype(np.uint8)
    return cv2.distanceTransform(outside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) <= radius_px


SHIFT = 4
"""Fractional bits of OpenCV's drawing."""


def _draw(out: Mask, stroke: Stroke, value: int) -> None:
    """A line with round ends; OpenCV counts positions from the middle of the first pixel."""
    points = np.array(stroke.points_px, float).reshape(-1, 2) - 0.5
    corners = np.round(points * (1 << SHIFT)).astype(np.int32)
    width = max(1, round(2 * stroke.radius_px))
    if len(corners) > 1:
        cv2.polylines(out, [corners[:, None]], False, value, width, cv2.LINE_8, SHIFT)
    radius = round(stroke.radius_px * (1 << SHIFT))
    for x, y in corners[[0, -1]].tolist():
        cv2.circle(out, (x, y), radius, value, cv2.FILLED, cv2.LINE_8, SHIFT)


def draw_on_mask(project: Project, name: str, stroke: Stroke) -> None:
    """Change the photo's mask in masks/, which stays or becomes a png; what was there is kept.

    Raises InputError for a mask that cannot be read, OutputError.
    """
    made = stroked(mask_of(project, name), stroke)
    ok, data = cv2.imencode(SUFFIX, made)
    if not ok:
        raise OutputError(f"the mask of {name} could not be written as png")
    before = project.mask_path(name)
    step = _keep(project, name, before)
    target = before if before is not None and before.suffix.lower() == SUFFIX else None
    try:
        write_atomically(target or _usual(project, name), data.tobytes())
    except OutputError:
        step.unlink(missing_ok=True)  # nothing was done that could be taken back
        raise
    if before is not None and target is None:
        before.unlink()
    for old in _kept(project, name)[1:-MOST_KEPT]:
        old.unlink(missing_ok=True)


def steps_back(project: Project, name: str) -> int:
    """How many steps can be taken back."""
    return len(_kept(project, name))


def undo_mask(project: Project, name: str) -> None:
    """Put back the mask as it was before the last step. Raises UsageError where there is none."""
    kept = _kept(project, name)
    if not kept:
        raise UsageError(f"nothing was painted on {name} that could be taken back")
    last = kept[-1]
    now = project.mask_path(name)
    if last.suffix == NO_MASK:
        if now is not None:
            now.unlink()
    else:
        stem = last.stem.split("-", 1)[1]
        target = project.root / MASKS_FOLDER / f"{stem}{last.suffix}"
        write_atomically(target, last.read_bytes())
        if now is not None and now != target:
            now.unlink()
    last.unlink()


def _usual(project: Project, name: str) -> Path:
    return project.root / MASKS_FOLDER / f"{Path(name).stem}{SUFFIX}"


def _folder(project: Project, name: str) -> Path:
    return project.work / "masks" / name


def _kept(project: Project, name: str) -> list[Path]:
    folder = _folder(project, name)
    return sorted(folder.glob("[0-9]" * DIGITS + "-?*")) if folder.is_dir() else []


def _keep(project: Project, name: str, before: Path | None) -> Path:
    """Copy the mask aside, under a number and its own name; the copy."""
    kept = _kept(project, name)
    number = int(kept[-1].name.split("-", 1)[0]) + 1 if kept else 1
    label = f"{before.name}" if before is not None else f"mask{NO_MASK}"
    target = _folder(project, name) / f"{number:0{DIGITS}d}-{label}"
    write_atomically(target, b"" if before is None else before.read_bytes())
    return target
