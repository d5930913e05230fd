"""Registration by structure: patches of a rendering of the bare mesh are found in the photo.

Edges of normals and ambient occlusion are compared with edges of the photo by orientation
alone; each patch found is a pixel of the photo paired with a point of the surface, and a
robust pose follows from hundreds of them. Method: ours, after CFOG (Ye et al., TGRS 2019).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.errors import RegistrationError
from texproj.options import StructureOptions
from texproj.photo import Photo
from texproj.records import Fit
from texproj.register.motion import motion_px
from texproj.register.structure.solve import (
    FINE_SCALE_PX,
    LENS,
    Candidate,
    LensPrior,
    approach,
    covariance,
    refine,
    with_outline,
)
from texproj.register.structure.starts import cameras_around, placed_starts
from texproj.register.structure.verdict import Verdict, judge
from texproj.register.structure.view import Observation, StructureView
from texproj.render import Render
from texproj.solve.lm import LmFit
from texproj.solve.reprojection import displacement_variance, projection_jacobian

ROLLS_DEG = (-14.0, -7.0, 0.0, 7.0, 14.0)
"""Turns about the line of sight that are tried around the start."""
SCALES = (0.74, 0.86, 1.0, 1.16, 1.35)
"""Enlargements that are tried around the start: with the turns, all starts up to 400 px, 15 degrees
and 30 % of depth off were found on two scenes."""
STARTS = 5
"""Turned, enlarged and shifted starts that are followed up, the best ones; the right one was among
the first four on two scenes."""
SURE_SUPPORT = 0.75
"""Share of patches found in place at which no further start is tried; wrong places reach half."""
CONFIRMED_SUPPORT = 0.45
"""The same where two starts have led to the same place."""
STARTS_EACH = 2
"""Starts taken from each position of the wider search."""
SYSTEMATIC = 0.45
"""Error that all patches share (light from above, mostly), relative to their median offset: .3
to .55 on three scenes whose cameras are known ..."""
FULL_AGREEMENT = 0.5
"""... in which this share of patches agreed or more; in inverse proportion where fewer do."""
SAME_PLACE = 0.01
"""Image motion, as a share of the width, below which two candidates are the same."""


def register_structure(
    photo: Photo,
    prior: Camera,
    render: Render,
    options: StructureOptions | None = None,
    wider: bool = True,
) -> Fit:
    """The camera of `photo`, searched around `prior` (full size), and whether to believe it.

    photo: may be reduced; `options.working_px` on its longer side is enough. render: depth,
    normal and ambient occlusion of the mesh for a camera. The fit's camera is for the
    full-size photo; `accepted` is the verdict, `reason` says what to do if it is refused. wider:
    search from other positions too if the search around the start fails.
    Raises RegistrationError if no start leads anywhere.
    """
    options = options or StructureOptions()
    view = StructureView.of(photo, render, options.working_px, prior)
    fit = _attempt(view, prior, _likely_starts(view, prior), options)
    if wider and not (fit and fit.accepted):
        other = _attempt(view, prior, _wider_starts(view, prior), options)
        fit = max((f for f in (fit, other) if f), key=_rank, default=None)
    if fit is None:
        raise RegistrationError(
            f"{photo.info.name}: nothing in the photo looks like the mesh around the start camera "
            "(give a closer start, or pick 8 points)"
        )
    return fit


def _rank(fit: Fit) -> tuple[bool, float]:
    return fit.accepted, fit.quality["support"]


def _likely_starts(view: StructureView, prior: Camera) -> Iterator[Camera]:
    """Placements of the prior's view, the best first, and the prior itself."""
    rolls = tuple(np.radians(ROLLS_DEG))
    for start in placed_starts(view, prior, rolls, SCALES, STARTS):
        yield start.camera
    yield prior


def _wider_starts(view: StructureView, prior: Camera) -> Iterator[Camera]:
    """The best placements of what is seen from positions around the prior's."""
    rolls, scales = tuple(np.radians(ROLLS_DEG[1:-1])), SCALES[1:-1]
    found = [
        start
        for camera in cameras_around(view, prior)
        for start in placed_starts(view, camera, rolls, scales, STARTS_EACH)
    ]
    for start in sorted(found, key=lambda s: -s.score)[:STARTS]:
        yield start.camera


def _attempt(
    view: StructureView, prior: Camera, starts: Iterator[Camera], options: StructureOptions
) -> Fit | None:
    """The best supported of the cameras that the starts lead to, refined and judged."""
    found: list[Candidate] = []
    for start in starts:
        candidate = approach(view, start)
        if candidate is not None:
            found.append(candidate)
            if _settled(found):
                break
    if not found:
        return None
    best = max(found, key=lambda c: c.support).camera
    view = with_outline(view, best)
    refined = refine(view, best, LensPrior.of(prior, options))
    if refined is None:
        return None
    seen, fit = refined
    camera = view.full_camera(fit.x)
    return _fit(seen, fit, camera, judge(view, seen, camera, options, prior), options)


def _settled(found: list[Candidate]) -> bool:
    """The best candidate stands out, or another start led to the same place."""
    best = max(found, key=lambda c: c.support)
    if best.support >= SURE_SUPPORT:
        return True
    near = SAME_PLACE * best.camera.width
    again = [c for c in found if motion_px(c.camera, best.camera, best.seen) < near]
    return len(again) > 1 and best.support >= CONFIRMED_SUPPORT


def _fit(
    seen: Observation,
    fit: LmFit[Camera],
    camera: Camera,
    verdict: Verdict,
    options: StructureOptions,
) -> Fit:
    scale = camera.intrinsics.fx / fit.x.intrinsics.fx
    offset = fit.x.project(seen.xyz_in_world)[0] - seen.matches.target_px
    residual = np.linalg.norm(offset, axis=1)
    inliers = residual < 3 * FINE_SCALE_PX
    uncertainty = covariance(seen, fit)
    scatter = float(np.median(residual[inliers])) if inliers.any() else np.inf
    shared = SYSTEMATIC * scatter * max(1.0, FULL_AGREEMENT / max(verdict.agreement, 0.01))
    lens = LENS[: len(uncertainty) - 6]
    expected = scale * float(np.hypot(_spread_px(fit.x, seen, uncertainty, lens), shared))
    reason = verdict.reason or _too_uncertain(expected, camera, options)
    return Fit(
        camera=camera,
        method="structure",
        expected_error_px=expected,
        residual_px=residual * scale,
        inliers=inliers,
        covariance=uncertainty,
        solved=("rotation", "translation", *lens),
        accepted=not reason,
        reason=reason,
        quality={
            "patches": verdict.patches,
            "agreement": verdict.agreement,
            "support": verdict.support,
            "coverage": verdict.coverage,
            "moved": verdict.moved,
        },
    )


def _spread_px(
    camera: Camera, seen: Observation, uncertainty: Doubles, lens: tuple[str, ...]
) -> float:
    """Standard deviation of the surface's image by the fit's covariance, pixels of the level."""
    jacobian = projection_jacobian(camera, seen.xyz_in_world, lens)
    return float(np.sqrt(displacement_variance(jacobian, uncertainty).mean()))


def _too_uncertain(expected_px: float, camera: Camera, options: StructureOptions) -> str:
    percent = 100 * expected_px / max(camera.width, camera.height)
    if percent <= options.max_error_percent:
        return ""
    return f"expected error {percent:.2f} % of the photo's longer side (pick 8 points)"
