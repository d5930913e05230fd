"""Expected error of a solved camera over the surface, from its covariance."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Doubles
from texproj.solve.reprojection import displacement_variance, projection_jacobian
from texproj.solve.robust import Estimate

MOST_POINTS = 1000
"""So many points of the surface are enough to average over."""


def surface_points(estimate: Estimate, surface: Doubles | None) -> Doubles:
    """(m, 3) world points over which the expected error is averaged: those of `surface` that fall
    inside the picture; without any, the box that the inliers span.
    """
    camera = estimate.camera
    if surface is not None and len(surface):
        few = surface[:: max(1, len(surface) // (4 * MOST_POINTS))]
        seen = few[camera.inside(camera.project(few)[0])]
        if len(seen):
            return seen[:: max(1, len(seen) // MOST_POINTS)]
    return _picked_box(estimate)


def expected_error_px(estimate: Estimate, free: tuple[str, ...], points: Doubles) -> float:
    """Root mean square length, over the world `points`, of the image displacement that the
    covariance predicts, pixels.

    With noise estimated from few residuals the prediction follows Student's t: its variance
    grows by freedom / (freedom - 2).
    """
    student = estimate.freedom / max(estimate.freedom - 2, 0.5)
    return float(np.sqrt(predicted_variance(estimate, free, points).mean() * student))


def predicted_variance(estimate: Estimate, free: tuple[str, ...], points: Doubles) -> Doubles:
    """(m,) variance of the length of the displacement of each world point's image, px^2."""
    jacobian = projection_jacobian(estimate.camera, points, free)
    return displacement_variance(jacobian, estimate.covariance)


def _picked_box(estimate: Estimate) -> Doubles:
    """(75, 3) points: a grid over the inliers' rectangle in the picture, at three depths."""
    camera = estimate.camera
    xy, depth = camera.project(estimate.fit_points)
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
