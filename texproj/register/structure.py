"""Registration by structure: patches of a rendering of the bare mesh are found in the photo.

Edges of normals and ambient occlusion are compared with edges of the photo by orientation
alone; each patch found is a pixel of the photo paired with a point of the surface, and a
robust pose follows from hundreds of them. Method: ours, after CFOG (Ye et al., TGRS 2019).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.errors import RegistrationError
from texproj.options import StructureOptions
from texproj.photo import Photo
from texproj.records import Fit
from texproj.register.structure_solve import FINE_SCALE_PX, Candidate, approach, refine
from texproj.register.structure_start import motion_px, placed_starts
from texproj.register.structure_view import Observation, Render, StructureView
from texproj.register.verdict import Verdict, judge
from texproj.solve.lm import LmFit
from texproj.solve.reprojection import projection_jacobian

Array = NDArray[np.float64]

SAME_PLACE = 0.01
"""Image motion, as a share of the width, below which two candidates are the same."""


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


def _search(view: StructureView, prior: Camera, options: StructureOptions) -> Camera | None:
    """The best supported camera that the placements of the prior's view, and itself, lead to."""
    rolls = tuple(np.radians(options.rolls_deg))
    starts = placed_starts(view, prior, rolls, options.scales, options.starts)
    found: list[Candidate] = []
    for start in [*starts, prior]:
        candidate = approach(view, start)
        if candidate is None:
            continue
        found.append(candidate)
        if _settled(found, options):
            break
    return max(found, key=lambda c: c.support).camera if found else None


def _settled(found: list[Candidate], options: StructureOptions) -> bool:
    """The best candidate stands out, or another start led to the same place."""
    best = max(found, key=lambda c: c.support)
    if best.support >= options.sure_support:
        return True
    near = SAME_PLACE * best.camera.width
    again = [c for c in found if motion_px(c.camera, best.camera, best.seen) < near]
    return len(again) > 1 and best.support >= options.confirmed_support


def _finished(view: StructureView, prior: Camera, camera: Camera, options: StructureOptions) -> Fit:
    """Refined at the fine level, judged, and brought to full size."""
    seen, fit = refine(view, camera, prior.intrinsics.fx, options.focal_sigma)
    camera = fit.x.resized(prior.width, prior.height)
    return _fit(seen, fit, camera, judge(view, seen, camera, options))


def _fit(seen: Observation, fit: LmFit[Camera], camera: Camera, verdict: Verdict) -> Fit:
    scale = camera.width / seen.camera.width
    offset = fit.x.project(seen.xyz_in_world)[0] - seen.matches.target_px
    residual = np.linalg.norm(offset, axis=1)
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
