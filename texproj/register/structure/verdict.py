"""Is a camera right? Asked of the photo and the mesh alone, whatever method found the camera.

Patches of the rendering are sought in the photo around where the camera says they are. Where
the camera is right most are found there; where it is wrong they are found anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.options import StructureOptions
from texproj.photo import Photo
from texproj.register.motion import motion_px
from texproj.register.structure.mirror import mirrored_candidate
from texproj.register.structure.solve import (
    CHECK,
    LAST,
    LEAST_MATCHES,
    LensPrior,
    agrees,
    found_share,
    refine,
)
from texproj.register.structure.view import FINE, Observation, PatchRule, StructureView
from texproj.render import Render

MIN_SUPPORT = 0.33
"""Share of patches found in place, at half the working size, below which a camera is refused ..."""
MIN_AGREEMENT = 0.3
"""... unless that share at the working size is at least this. Of 210 starts on two scenes 132 were
right, none of which has less; the wrong ones that have more are mirrored photos."""
MIN_COVERAGE = 0.4
"""Share of the picture that must agree, counted in cells where the mesh is."""
FAR = 0.2
"""Image motion from the start, as a share of the width, from which on more is asked ..."""
FAR_SUPPORT = 0.55
"""... namely this share of patches in place: what looks alike elsewhere has less."""
MOST_SIGMAS = 4.0
"""Deviation of the focal length from the one given that is no longer believed."""
CELLS = 6
"""The picture is divided in so many rows and columns to see how far the agreement reaches."""
LEAST_SYMMETRY = 0.8
"""Support of the mirrored photo, relative to the photo's, from which on the two are compared."""
DETAILS = (PatchRule(FINE, size_px=33, step_px=12, radius_px=8), LAST)
DETAIL_WITHIN_PX = (2.0, 3.0)
"""Patches, and distances counted as found, that tell a facade from its mirror image."""
MIRROR_MARGIN = 0.005
"""By how much more of them the mirrored photo must show in place; a castle whose two halves
are alike differs from its mirror image by .010 to .056, on all of seven photos, either way."""


@dataclass(frozen=True)
class Verdict:
    """Whether a camera is to be believed.

    registered: it is; reason: why not, and what to do, or what to mind; agreement: share of fine
    patches found where they should be; support: the same for the middle level; coverage: share of
    the cells with patches in which one agrees; patches: how many fine patches there were; moved:
    mean image motion from the camera that was given to the one judged, as a share of the width.
    """

    registered: bool
    reason: str
    agreement: float
    support: float
    coverage: float
    patches: int
    moved: float = 0.0


def verify(
    photo: Photo, camera: Camera, render: Render, options: StructureOptions | None = None
) -> Verdict:
    """Whether `camera` (full size, from any method) explains `photo`."""
    options = options or StructureOptions()
    view = StructureView.of(photo, render, options.working_px, camera)
    return judge(view, view.observe(camera, LAST), camera, options)


def judge(
    view: StructureView,
    seen: Observation,
    camera: Camera,
    options: StructureOptions,
    prior: Camera | None = None,
) -> Verdict:
    """The verdict on `camera`, whose view was `seen` at the fine level.

    prior: the camera from which it was searched, whose place and focal length count as evidence.
    """
    prior = prior or camera
    verdict = Verdict(
        registered=False,
        reason="",
        agreement=found_share(seen),
        support=found_share(view.observe(camera, CHECK)),
        coverage=covered_share(seen),
        patches=seen.patches,
        moved=motion_px(camera, prior, seen.xyz_in_world) / camera.width,
    )
    zoom = abs(np.log(camera.intrinsics.fx / prior.intrinsics.fx)) / options.focal_sigma
    reason = _refusal(verdict, float(zoom))
    if not reason and _mirrored_fits_better(view, camera, verdict.support, options):
        reason = "the photo fits better with left and right exchanged (is it a mirrored scan?)"
    return replace(verdict, registered=not reason, reason=reason)


def covered_share(seen: Observation) -> float:
    """Share of the cells that hold patches in which at least one agrees."""
    size = (seen.camera.width, seen.camera.height)
    asked = _cells(seen.grid_px, size)
    held = _cells(seen.matches.source_px[agrees(seen)], size)
    return len(held) / max(len(asked), 1)


def _cells(xy_px: Doubles, size: tuple[int, int]) -> set[tuple[int, int]]:
    column, row = (xy_px * CELLS / size).astype(int).T
    return set(zip(column.tolist(), row.tolist(), strict=True))


def _mirrored_fits_better(
    view: StructureView, camera: Camera, support: float, options: StructureOptions
) -> bool:
    mirrored = view.mirrored
    rival = mirrored_candidate(view, camera, LEAST_SYMMETRY * support)
    if rival is None:
        return False
    refined = refine(mirrored, rival.camera, LensPrior.of(camera, options))
    if refined is None:
        return False
    own = _detail(view, camera)
    other = _detail(mirrored, mirrored.full_camera(refined[1].x))
    return other > own + MIRROR_MARGIN


def _detail(view: StructureView, camera: Camera) -> float:
    """Share of small patches in place, averaged over their sizes and what counts as in place."""
    seen = [view.observe(camera, rule) for rule in DETAILS]
    return float(np.mean([found_share(s, px) for s in seen for px in DETAIL_WITHIN_PX]))


def _refusal(verdict: Verdict, zoom_sigmas: float) -> str:
    """Why the camera is not to be believed; empty if it is."""
    if verdict.patches < LEAST_MATCHES:
        return "too little of the mesh is in view to tell (give a closer start, or pick 8 points)"
    if verdict.agreement < MIN_AGREEMENT and verdict.support < MIN_SUPPORT:
        return (
            f"only {verdict.support:.0%} of the mesh's structure is found where this camera "
            "puts it (pick 8 points, or give a closer start)"
        )
    if verdict.coverage < MIN_COVERAGE:
        return (
            f"only {verdict.coverage:.0%} of the picture agrees with the mesh "
            "(pick 8 points spread over the picture)"
        )
    if verdict.moved > FAR and verdict.support < FAR_SUPPORT:
        return (
            f"it lies {verdict.moved:.0%} of the picture's width from the start, and the object "
            "may look alike elsewhere (pick 8 points, or start closer)"
        )
    if zoom_sigmas > MOST_SIGMAS:
        return "the focal length would be far from the start's (pick 6 points, or correct it)"
    return ""
