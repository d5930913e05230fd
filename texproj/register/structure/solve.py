"""From a start to a camera: match, agree on a pose, repeat; then least squares over all matches."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.options import StructureOptions
from texproj.register.motion import motion_px
from texproj.register.structure.view import FINE, MIDDLE, Observation, PatchRule, StructureView
from texproj.solve.lm import LmFit, LmOptions, Loss, minimize
from texproj.solve.pnp import MsacOptions, msac_pose
from texproj.solve.reprojection import Prior, Reprojection

# In pixels of levels that are 768 and 384 px long; chosen on two scenes (see the benchmark).
WIDE = PatchRule(MIDDLE, size_px=41, step_px=18, radius_px=20, peaks=2)
NEAR = PatchRule(MIDDLE, size_px=41, step_px=18, radius_px=12)
EXACT = PatchRule(FINE, size_px=65, step_px=24, radius_px=12)
LAST = PatchRule(FINE, size_px=49, step_px=16, radius_px=8)
CHECK = PatchRule(MIDDLE, size_px=41, step_px=18, radius_px=8)

MIDDLE_SCALE_PX, FINE_SCALE_PX = 1.0, 1.5
"""Cauchy scales: the scatter of right matches at each level."""
FOUND_WITHIN_PX = 2.0
"""A patch agrees with a camera if found this close to its place, pixels of the level."""
LENS = ("focal", "k1")
"""Intrinsics that may be solved, in the order of the covariance."""
LEAST_MATCHES = 12
"""Matches, and patches, below which nothing is concluded."""
FULL_PATCHES = 50
"""A share is taken of so many patches at least: a few may agree by chance."""
LEAST_SUPPORT = 0.1
"""Share of patches that must agree on a start's camera for it to be followed any further."""
STILL_PX, MOST_ROUNDS = 0.5, 3
"""Motion, pixels of the fine level, at which refining stops, and most repetitions."""
SURE_SIGMAS = 4.5
"""Significance from which on a change of k1 is believed; lenses without any gave up to 3.8."""
STEPS = LmOptions(max_iterations=30, cost_tolerance=1e-6)


@dataclass(frozen=True)
class LensPrior:
    """What is known of the full-size photo's lens: fx with a relative standard deviation, and k1
    with an absolute one, 0 if it is not to be solved.
    """

    focal_px: float
    focal_sigma: float
    k1: float = 0.0
    k1_sigma: float = 0.0

    @classmethod
    def of(cls, camera: Camera, options: StructureOptions) -> LensPrior:
        k = camera.intrinsics
        k1 = k.dist[0] if k.dist else 0.0
        return cls(k.fx, options.focal_sigma, k1, 0.0 if k.is_fisheye else options.k1_sigma)

    @property
    def free(self) -> tuple[str, ...]:
        """The intrinsics to solve."""
        return LENS if self.k1_sigma else LENS[:1]

    def priors(self, enlarged: float) -> tuple[Prior, ...]:
        """For the least squares in a picture enlarged by a factor."""
        focal = Prior("focal", float(np.log(self.focal_px * enlarged)), self.focal_sigma)
        return (focal, Prior("k1", self.k1, self.k1_sigma)) if self.k1_sigma else (focal,)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A camera (full size), the share of patches found where it puts them (middle level), and
    (n, 3) surface points in its view.
    """

    camera: Camera
    support: float
    seen: Doubles


def approach(view: StructureView, start: Camera) -> Candidate | None:
    """The camera to which the matches lead from `start` at the middle level; None if nowhere."""
    found: Candidate | None = None
    for rule in (WIDE, NEAR):
        seen = view.observe(start, rule)
        camera = consensus(view, seen, MIDDLE_SCALE_PX)
        if camera is None:
            return None
        found = Candidate(
            camera, explained_share(seen, view.camera_at(camera, rule.level)), seen.xyz_in_world
        )
        if found.support < LEAST_SUPPORT:
            return None
        start = camera
    return found


def with_outline(view: StructureView, camera: Camera) -> StructureView:
    """The view that counts the mesh's outline as an edge, if the photo shows it where `camera`
    says; else the view as it is.
    """
    outlined = replace(view, outline=True)
    better = found_share(outlined.observe(camera, CHECK)) > found_share(view.observe(camera, CHECK))
    return outlined if better else view


def refine(
    view: StructureView, camera: Camera, known: LensPrior
) -> tuple[Observation, LmFit[Camera]] | None:
    """The last matches at the fine level and the fit to them, pose and lens together.

    k1 is solved only if it differs from what is known by `SURE_SIGMAS`. None if there is too
    little to match.
    """
    seen = view.observe(camera, EXACT)
    agreed = consensus(view, seen, FINE_SCALE_PX)
    if agreed is None:
        return None
    plain = replace(known, k1_sigma=0.0)
    fit = least_squares(view, seen, view.camera_at(agreed, FINE), plain)
    found = _settle(view, fit, plain)
    if found is None or not known.k1_sigma:
        return found
    seen, fit = found
    bent = least_squares(view, seen, fit.x, known)
    change = abs(bent.x.intrinsics.dist[0] - known.k1)
    if change < SURE_SIGMAS * np.sqrt(covariance(seen, bent)[-1, -1]):
        return found
    return _settle(view, bent, known)


def _settle(
    view: StructureView, fit: LmFit[Camera], known: LensPrior
) -> tuple[Observation, LmFit[Camera]] | None:
    """Matched again until the camera stays where it is, so that the matches are its own."""
    for _ in range(MOST_ROUNDS):
        seen = view.observe(view.full_camera(fit.x), LAST)
        if len(seen.matches) < LEAST_MATCHES:
            return None
        fit = least_squares(view, seen, seen.camera, known)
        if motion_px(fit.x, seen.camera, seen.xyz_in_world) < STILL_PX:
            break
    return seen, fit


def covariance(seen: Observation, fit: LmFit[Camera]) -> Doubles:
    """(p, p) of the fit's parameters; overlapping patches repeat each other."""
    return fit.covariance() * (seen.rule.size_px / seen.rule.step_px) ** 2


def consensus(view: StructureView, seen: Observation, scale_px: float) -> Camera | None:
    """The camera (full size) with the pose on which most matches agree; None if none do."""
    matches = seen.matches
    if len(matches) < LEAST_MATCHES:
        return None
    threshold = max(2.5, seen.rule.radius_px / 6)
    setting = MsacOptions(threshold, polished=1)
    fit = msac_pose(matches.target_px, seen.xyz_in_world, seen.camera.intrinsics, setting)
    if fit is None:
        return None
    problem = Reprojection(matches.target_px, seen.xyz_in_world, scale_px)
    found = minimize(problem, replace(seen.camera, pose=fit.pose), Loss("cauchy"), STEPS).x
    return view.full_camera(found)


def least_squares(
    view: StructureView, seen: Observation, camera: Camera, known: LensPrior
) -> LmFit[Camera]:
    """All matches under a Cauchy loss from a camera of the level; so is the fit's."""
    enlarged = camera.intrinsics.fx / view.full_camera(camera).intrinsics.fx
    # patches that overlap repeat each other: so much less is known than their number says
    sigma = FINE_SCALE_PX * seen.rule.size_px / seen.rule.step_px
    problem = Reprojection(
        seen.matches.target_px,
        seen.xyz_in_world,
        sigma,
        known.free,
        known.priors(enlarged),
    )
    return minimize(problem, camera, Loss("cauchy", FINE_SCALE_PX / sigma), STEPS)


def agrees(seen: Observation, within_px: float = FOUND_WITHIN_PX) -> NDArray[np.bool_]:
    """(n,) which matches are closer than `within_px`, pixels of the level, to their place."""
    return np.linalg.norm(seen.offset_px, axis=1) < within_px


def found_share(seen: Observation, within_px: float = FOUND_WITHIN_PX) -> float:
    """Share of all patches sought that were found in place."""
    return float(agrees(seen, within_px).sum() / max(seen.patches, FULL_PATCHES))


def explained_share(seen: Observation, camera: Camera) -> float:
    """Share of all patches sought of which a match is in place for another camera of the level."""
    gap = np.linalg.norm(camera.project(seen.xyz_in_world)[0] - seen.matches.target_px, axis=1)
    explained = np.unique(seen.matches.patch[gap < FOUND_WITHIN_PX])
    return len(explained) / max(seen.patches, FULL_PATCHES)
