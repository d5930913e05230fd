"""Registration by structure: patches of a rendering of the bare mesh are found in the photo.

Edges of normals and ambient occlusion are compared with edges of the photo by orientation
alone; each patch found is a pixel of the photo paired with a point of the surface, and a
robust pose follows from hundreds of them. Method: ours, after CFOG (Ye et al., TGRS 2019).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.errors import RegistrationError
from texproj.options import StructureOptions
from texproj.photo import Photo
from texproj.records import Fit
from texproj.register.structure_start import placed_starts
from texproj.register.structure_view import (
    FINE,
    MIDDLE,
    Observation,
    PatchRule,
    Render,
    StructureView,
)
from texproj.register.verdict import Verdict, judge, support
from texproj.solve.lm import LmFit, LmOptions, Loss, minimize
from texproj.solve.pnp import MsacOptions, msac_pose
from texproj.solve.reprojection import Prior, Reprojection, projection_jacobian

Array = NDArray[np.float64]

# Sizes in pixels of the levels (768, 384, 192 px); measured on two scenes, see the benchmark.
WIDE = PatchRule(MIDDLE, size_px=41, step_px=18, radius_px=20, peaks=2)
NEAR = PatchRule(MIDDLE, size_px=41, step_px=18, radius_px=12)
EXACT = PatchRule(FINE, size_px=65, step_px=20, radius_px=12)
LAST = PatchRule(FINE, size_px=65, step_px=20, radius_px=8)

MIDDLE_SCALE_PX, FINE_SCALE_PX = 1.0, 1.5
"""Cauchy scales: the matches' scatter at each level."""
LEAST_MATCHES = 12
STEPS = LmOptions(max_iterations=30, cost_tolerance=1e-6)


def register_structure(
    photo: Photo, prior: Camera, render: Render, options: StructureOptions | None = None
) -> Fit:
    """The camera of `photo`, searched around `prior` (full size), and whether to believe it.

    photo: may be reduced; `options.working_px` on its longer side is enough. render: depth,
    normal and ambient occlusion of the mesh for a camera. The fit's camera is for the
    full-size photo; `accepted` is the verdict, `reason` says what to do if it is refused.
    Raises RegistrationError if the mesh or the photo shows nothing that could be matched.
    """
    options = options or StructureOptions()
    view = StructureView.of(photo, render, options.working_px)
    start = _search(view, prior, options)
    if start is None:
        raise RegistrationError(
            f"{photo.info.name}: the start camera sees too little of the mesh to compare "
            "(give a closer start, or pick 4 points)"
        )
    return _finished(view, prior, start, options)


@dataclass(frozen=True, eq=False)
class _Candidate:
    camera: Camera
    support: float


def _search(view: StructureView, prior: Camera, options: StructureOptions) -> Camera | None:
    """The best supported of the candidates, from placements of the prior's view and itself."""
    rolls = np.radians(options.rolls_deg)
    starts = placed_starts(view, prior, tuple(rolls), options.scales, options.starts)
    best: _Candidate | None = None
    for start in [*starts, prior]:
        candidate = _approach(view, start)
        if candidate is None:
            continue
        if best is None or candidate.support > best.support:
            best = candidate
        if best.support > options.sure_support:
            break
    return best.camera if best else None


def _approach(view: StructureView, start: Camera) -> _Candidate | None:
    camera: Camera | None = start
    for rule in (WIDE, NEAR):
        camera = _consensus(view.observe(camera, rule), camera) if camera else None
    if camera is None:
        return None
    return _Candidate(camera, support(view, camera))


def _consensus(seen: Observation, camera: Camera) -> Camera | None:
    """`camera` (full size) moved to the pose on which most matches agree."""
    if len(seen.matches) < LEAST_MATCHES:
        return None
    radius = 20 if seen.matches.rank.any() else 12
    fit = msac_pose(
        seen.matches.target_px,
        seen.xyz_in_world,
        seen.camera.intrinsics,
        MsacOptions(max(2.5, radius / 6), polished=1),
    )
    if fit is None:
        return None
    problem = Reprojection(seen.matches.target_px, seen.xyz_in_world, MIDDLE_SCALE_PX)
    found = minimize(problem, replace(seen.camera, pose=fit.pose), Loss("cauchy"), STEPS).x
    return replace(camera, pose=found.pose)


def _finished(view: StructureView, prior: Camera, camera: Camera, options: StructureOptions) -> Fit:
    """Refined at the fine level, judged, and brought to full size."""
    seen = view.observe(camera, EXACT)
    moved = _consensus(seen, camera) or camera
    fit = _least_squares(seen, moved, prior, options)
    camera = _full_size(fit.x, prior)
    seen = view.observe(camera, LAST)
    fit = _least_squares(seen, camera, prior, options)
    camera = _full_size(fit.x, prior)
    return _fit(seen, fit, camera, judge(view, camera, options))


def _least_squares(
    seen: Observation, camera: Camera, prior: Camera, options: StructureOptions
) -> LmFit[Camera]:
    """All matches under a Cauchy loss, pose and focal length together, at the level's size."""
    here = camera.resized(seen.camera.width, seen.camera.height)
    expected = np.log(prior.intrinsics.fx * here.width / prior.width)
    problem = Reprojection(
        seen.matches.target_px,
        seen.xyz_in_world,
        FINE_SCALE_PX,
        ("focal",),
        (Prior("focal", float(expected), options.focal_sigma),),
    )
    return minimize(problem, here, Loss("cauchy"), STEPS)


def _full_size(camera: Camera, prior: Camera) -> Camera:
    """`camera` of a level for the full-size photo; sizes are the prior's, not rounded ones."""
    return camera.resized(prior.width, prior.height)


def _fit(seen: Observation, fit: LmFit[Camera], camera: Camera, verdict: Verdict) -> Fit:
    scale = camera.width / seen.camera.width
    residual = np.linalg.norm(fit.residual, axis=1) * FINE_SCALE_PX
    covariance = fit.covariance()
    jacobian = projection_jacobian(fit.x, seen.xyz_in_world, ("focal",))
    spread = np.einsum("nip,pq,niq->n", jacobian, covariance, jacobian)
    return Fit(
        camera=camera,
        method="structure",
        expected_error_px=float(np.sqrt(spread.mean())) * scale,
        residual_px=residual * scale,
        inliers=residual < 3 * FINE_SCALE_PX,
        covariance=covariance,
        solved=("rotation", "translation", "focal"),
        accepted=verdict.registered,
        reason=verdict.reason,
        quality={
            "patches": verdict.patches,
            "agreement": verdict.agreement,
            "support": verdict.support,
            "coverage": verdict.coverage,
        },
    )
