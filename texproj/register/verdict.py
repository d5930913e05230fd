"""Is a camera right? Asked of the photo and the mesh alone, whatever method found the camera.

Patches of the rendering are sought in the photo around where the camera says they are. Where
the camera is right most are found there; where it is wrong they are found anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.options import StructureOptions
from texproj.photo import Photo
from texproj.register.structure_view import (
    FINE,
    MIDDLE,
    Observation,
    PatchRule,
    Render,
    StructureView,
)

Array = NDArray[np.float64]

COARSE_CHECK = PatchRule(MIDDLE, size_px=41, step_px=18, radius_px=8)
FINE_CHECK = PatchRule(FINE, size_px=65, step_px=20, radius_px=16)
FOUND_WITHIN_PX = 2.0
"""A patch agrees if found this close to its place, pixels of the level."""
CELLS = 6
"""The picture is divided in so many rows and columns to see how far the agreement reaches."""
LEAST_PATCHES = 12


@dataclass(frozen=True)
class Verdict:
    """registered: believe it; reason: why not, and what to do, or what to mind.

    agreement: share of fine patches found where they should be; support: the same for the
    middle level; coverage: share of the cells with patches in which one agrees;
    patches: how many fine patches there were.
    """

    registered: bool
    reason: str
    agreement: float
    support: float
    coverage: float
    patches: int


def verify(
    photo: Photo, camera: Camera, render: Render, options: StructureOptions | None = None
) -> Verdict:
    """Whether `camera` (full size, from any method) explains `photo`."""
    options = options or StructureOptions()
    return judge(StructureView.of(photo, render, options.working_px), camera, options)


def judge(view: StructureView, camera: Camera, options: StructureOptions) -> Verdict:
    """The verdict on `camera` for a photo already prepared."""
    coarse, fine = view.observe(camera, COARSE_CHECK), view.observe(camera, FINE_CHECK)
    agreement, support_ = found_share(fine), found_share(coarse)
    coverage = covered_share(fine)
    reason = _refusal(agreement, support_, coverage, fine.patches, options)
    return Verdict(not reason, reason, agreement, support_, coverage, fine.patches)


def support(view: StructureView, camera: Camera) -> float:
    """Share of middle-level patches found where `camera` says they are; a fast first opinion."""
    return found_share(view.observe(camera, COARSE_CHECK))


def found_share(seen: Observation) -> float:
    """Share of all patches sought that were found within `FOUND_WITHIN_PX`."""
    return float(_agrees(seen).sum() / max(seen.patches, LEAST_PATCHES))


def covered_share(seen: Observation) -> float:
    """Share of the cells that hold patches in which at least one agrees."""
    size = (seen.camera.width, seen.camera.height)
    asked = _cells(seen.grid_px, size)
    held = _cells(seen.matches.source_px[_agrees(seen)], size)
    return len(held) / max(len(asked), 1)


def _agrees(seen: Observation) -> NDArray[np.bool_]:
    return np.linalg.norm(seen.offset_px, axis=1) < FOUND_WITHIN_PX


def _cells(xy_px: Array, size: tuple[int, int]) -> set[tuple[int, int]]:
    column, row = (xy_px * CELLS / size).astype(int).T
    return set(zip(column.tolist(), row.tolist(), strict=True))


def _refusal(
    agreement: float, support_: float, coverage: float, patches: int, options: StructureOptions
) -> str:
    """Why the camera is not to be believed; empty if it is."""
    if patches < LEAST_PATCHES:
        return "too little of the mesh is in view to tell (give a closer start, or pick 4 points)"
    if agreement < options.min_agreement and support_ < options.min_support:
        return (
            f"only {agreement:.0%} of the mesh's structure is found where this camera puts it "
            "(pick 4 points, or give a closer start)"
        )
    if coverage < options.min_coverage:
        return (
            f"only {coverage:.0%} of the picture agrees with the mesh "
            "(pick 4 points spread over the picture)"
        )
    return ""
