"""The camera of a photo from picked pairs of pixels and mesh points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import RegistrationError
from texproj.options import PointsOptions
from texproj.photo import Correspondences, PhotoInfo
from texproj.records import Fit
from texproj.register import picks as check
from texproj.register.lens import Lens, lens_guess
from texproj.solve.pnp import MsacOptions, sampled_poses
from texproj.solve.reprojection import Reprojection, projection_jacobian
from texproj.solve.robust import Estimate, Noise, robust_estimate

Array = NDArray[np.float64]

DEFAULTS = PointsOptions()

GROSS = 0.015
"""A pick further off than this part of the longer side is never near in the first round."""

OVERRULE = 20.0
"""Drop of the description length, twice the log of the odds, at which picks overrule a focal
length that is called known."""


def register_points(
    info: PhotoInfo,
    picks: Correspondences,
    prior: Intrinsics | None = None,
    options: PointsOptions = DEFAULTS,
    start: Pose | None = None,
    surface: Array | None = None,
) -> Fit:
    """The camera that the picks see.

    prior: intrinsics of cameras.json, trusted unless `options.focal` says otherwise or the picks
    contradict them; without it the focal length of EXIF, else a usual one, is the first guess.
    start: a pose to try besides those found from the picks.
    surface: (m, 3) world points (some hundred vertices) over whose image, where it falls inside
    the picture, the expected error is averaged; without it, the box that the picks span in the
    picture and in depth, a quarter larger on each side.

    Raises RegistrationError with one sentence that says which points to add.
    """
    check.refuse_unusable(info, picks)
    task = _Task(info, picks, options, start)
    lens = lens_guess(info, prior, options)
    found = task.solve(lens)
    note = ""
    if lens.checked:
        free = task.solve(lens.freed("focal"))
        if free.estimate.length + OVERRULE < found.estimate.length:
            f = free.estimate.camera.intrinsics.fx
            note = (
                f"the given focal length of {lens.intrinsics.fx:.0f} px contradicts the picks "
                f"and was solved: {f:.0f} px"
            )
            found = free
    check.refuse_too_few(info, picks, found.estimate, 6 + len(found.lens.free))
    check.refuse_shape(info, picks, found.estimate, found.lens)
    error = expected_error_px(found.estimate, found.lens.free, surface)
    limit = options.max_error_percent / 100 * max(info.width, info.height)
    check.refuse_uncertain(info, found.estimate, error, limit)
    return _fit(picks, found, error, note)


@dataclass(frozen=True, eq=False)
class _Found:
    lens: Lens
    estimate: Estimate


@dataclass(frozen=True, eq=False)
class _Task:
    """One photo's picks and how to search."""

    info: PhotoInfo
    picks: Correspondences
    options: PointsOptions
    start: Pose | None

    @property
    def noise(self) -> Noise:
        side = max(self.info.width, self.info.height)
        nominal = self.options.pick_sigma_percent / 100 * side
        return Noise(nominal, GROSS * side, self.info.width * self.info.height)

    def solve(self, lens: Lens) -> _Found:
        """The best estimate over all starts; raises RegistrationError if there is none."""
        problem = Reprojection(
            self.picks.xy_px, self.picks.xyz_in_world, 1.0, lens.free, lens.priors
        )
        estimates = [robust_estimate(problem, camera, self.noise) for camera in self.starts(lens)]
        sound = [e for e in estimates if e is not None and np.isfinite(e.covariance).all()]
        if not sound:
            raise RegistrationError(check.nothing_fits(self.info, self.picks))
        return _Found(lens, min(sound, key=lambda e: e.length))

    def starts(self, lens: Lens) -> list[Camera]:
        lenses = lens.focal_candidates()
        options = MsacOptions(
            self.noise.gross_px, 600 if len(lenses) == 1 else 200, seed=self.options.seed
        )
        cameras = [
            Camera(k, pose)
            for k in lenses
            for pose in sampled_poses(self.picks.xy_px, self.picks.xyz_in_world, k, options)[:3]
        ]
        if self.start is not None:
            cameras.append(Camera(lens.intrinsics, self.start))
        return cameras


def expected_error_px(estimate: Estimate, free: tuple[str, ...], surface: Array | None) -> float:
    """Root mean square length of the image displacement that the covariance predicts over the
    surface (see `register_points`), pixels.

    With noise estimated from few residuals the prediction follows Student's t: its variance
    grows by freedom / (freedom - 2).
    """
    variance = predicted_variance(estimate, free, surface)[1]
    student = estimate.freedom / max(estimate.freedom - 2, 0.5)
    return float(np.sqrt(variance.mean() * student))


def predicted_variance(
    estimate: Estimate, free: tuple[str, ...], surface: Array | None
) -> tuple[Array, Array]:
    """((m, 2) pixels, (m,) variance of the displacement's length there, px^2)."""
    camera = estimate.camera
    points = surface
    if points is not None:
        xy = camera.project(points)[0]
        points = points[camera.inside(xy)]
    if points is None or not len(points):
        points = _picked_box(estimate)
    jacobian = projection_jacobian(camera, points, free)
    variance = np.einsum("nij,jk,nik->n", jacobian, estimate.covariance, jacobian)
    return camera.project(points)[0], variance


def _picked_box(estimate: Estimate) -> Array:
    """(75, 3) points: a grid over the inliers' rectangle in the picture, at three depths."""
    camera = estimate.camera
    xyz = estimate.fit_points
    xy, depth = camera.project(xyz)
    low, high = xy.min(axis=0), xy.max(axis=0)
    grow = 0.25 * (high - low)
    low = np.maximum(low - grow, 0)
    high = np.minimum(high + grow, (camera.width, camera.height))
    u, v, z = np.meshgrid(
        np.linspace(low[0], high[0], 5), np.linspace(low[1], high[1], 5),
        [depth.min(), np.median(depth), depth.max()],
    )  # fmt: skip
    points = camera.unproject(np.stack([u.ravel(), v.ravel()], axis=1), z.ravel())
    return points[np.isfinite(points).all(axis=1)]


def _fit(picks: Correspondences, found: _Found, error: float, note: str) -> Fit:
    e = found.estimate
    outliers = [name for name, good in zip(picks.names, e.inliers, strict=True) if not good]
    reasons = [note] if note else []
    if outliers:
        reasons.append(f"picks that do not fit and were left out: {', '.join(outliers)}")
    quality: dict[str, Any] = {
        "picks": len(picks), "inliers": int(e.inliers.sum()), "outliers": outliers,
        "pick_sigma_px": e.sigma_px, "solved": list(found.lens.free),
        "focal_px": e.camera.intrinsics.fx, "iterations": e.fit.iterations,
        "initial_cost": e.fit.initial_cost, "cost": e.fit.cost, "stop": e.fit.stop,
    }  # fmt: skip
    if "focal" in found.lens.free:
        quality["focal_sigma_percent"] = 100 * e.sigma_of(found.lens.free, "focal")
    return Fit(
        e.camera, "points", error, e.distance_px, e.inliers, e.covariance,
        ("rotation", "translation", *found.lens.free), picks.names,
        reason="; ".join(reasons), quality=quality,
    )  # fmt: skip
