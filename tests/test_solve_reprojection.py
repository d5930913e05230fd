"""The reprojection problem: exact at the truth, its jacobian, its cost."""

from dataclasses import replace

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.solve.lm import minimize
from texproj.solve.reprojection import INTRINSIC_NAMES, Prior, Reprojection, intrinsic_value

LENSES = {
    "none": (),
    "k1k2": (-0.12, 0.05, 0.0, 0.0),
    "five": (-0.12, 0.05, 0.002, -0.003, 0.01),
    "rational": (0.1, -0.05, 0.002, -0.003, 0.01, 0.02, -0.01, 0.005),
    "tilted": (0.1, -0.05, 0.002, -0.003, 0.01, 0.02, -0.01, 0.005, 1e-3, 2e-3, -1e-3, 3e-3, 0.02,
               -0.03),
}  # fmt: skip


def scene(dist, offset=0.0, n=12):
    rng = np.random.default_rng(7)
    pose = Pose.look_at(np.array([3.0, -4, 2]) + offset, np.full(3, offset))
    camera = Camera(Intrinsics(1000, 800, 1100, 1120, 510, 380, dist), pose)
    xyz = rng.uniform(-1, 1, (n, 3)) + offset
    return camera, xyz, camera.project(xyz)[0]


@pytest.mark.parametrize("dist", LENSES.values(), ids=LENSES)
def test_truth_has_zero_residual_and_gradient(dist):
    """At the camera that made the pixels nothing is left to improve."""
    camera, xyz, xy = scene(dist)
    problem = Reprojection(xy, xyz, 1.5, INTRINSIC_NAMES)
    residual = problem.residual(camera)
    assert abs(residual).max() == 0
    assert minimize(problem, camera).cost == 0


@pytest.mark.parametrize("dist", LENSES.values(), ids=LENSES)
def test_jacobian_agrees_with_central_differences(dist):
    """Every column, pose and lens, under every distortion model, relative to 1e-6."""
    camera, xyz, xy = scene(dist)
    problem = Reprojection(xy, xyz, 1.0, INTRINSIC_NAMES)
    analytic = problem.jacobian(camera)
    assert analytic.shape == (12, 2, 6 + len(INTRINSIC_NAMES))
    for i in range(analytic.shape[2]):
        delta = np.zeros(analytic.shape[2])
        delta[i] = 1e-5
        ahead, behind = problem.step(camera, delta), problem.step(camera, -delta)
        numeric = (problem.residual(ahead) - problem.residual(behind)) / 2e-5
        assert np.abs(analytic[:, :, i] - numeric).max() < 1e-6 * max(1, np.abs(numeric).max())


def test_small_step_changes_the_cost_as_the_jacobian_says():
    """Cost and gradient agree: d cost = 2 r'J delta to second order."""
    camera, xyz, xy = scene(LENSES["five"])
    problem = Reprojection(xy + 3.0, xyz, 1.5, ("focal", "cx", "k1"))
    delta = np.random.default_rng(1).normal(0, 1e-6, 9)
    r, jacobian = problem.residual(camera), problem.jacobian(camera)
    moved = problem.residual(problem.step(camera, delta))
    told = 2 * np.einsum("ni,nij,j->", r, jacobian, delta)
    assert (moved**2).sum() - (r**2).sum() == pytest.approx(told, rel=1e-2)


@pytest.mark.parametrize("offset", [0.0, 4e6])
def test_disturbed_camera_comes_back(offset):
    """Pose, focal length, center and distortion are found again, also at map coordinates."""
    camera, xyz, xy = scene(LENSES["k1k2"], offset, n=40)
    free = ("focal", "cx", "cy", "k1", "k2")
    problem = Reprojection(xy, xyz, 1.0, free)
    disturbed = problem.step(camera, [0.03, -0.02, 0.05, 0.1, -0.1, 0.2, 0.1, 20, -15, 0.05, -0.02])
    fit = minimize(problem, disturbed)
    assert np.linalg.norm(fit.residual, axis=1).max() < (1e-4 if offset else 1e-8)
    assert fit.x.intrinsics.fx == pytest.approx(camera.intrinsics.fx, rel=1e-5)
    assert np.linalg.norm(fit.x.center - camera.center) < 1e-4


def test_coefficients_that_are_not_free_stay():
    """Solving the focal length leaves the given distortion and aspect exactly as they were."""
    camera, xyz, xy = scene(LENSES["tilted"])
    start = replace(camera, intrinsics=replace(camera.intrinsics, fx=1210.0, fy=1232.0))
    found = minimize(Reprojection(xy, xyz, 1.0, ("focal",)), start).x.intrinsics
    assert found.dist == camera.intrinsics.dist
    assert found.fx == pytest.approx(1100, rel=1e-6)
    assert found.fy / found.fx == pytest.approx(1120 / 1100, rel=1e-9)


def test_prior_pulls_as_strongly_as_it_says():
    """A prior one sigma off with perfect data of overwhelming weight costs one, and no more."""
    camera, xyz, xy = scene(())
    k = camera.intrinsics
    prior = Prior("cx", intrinsic_value(k, "cx") + 2.0, 2.0)
    problem = Reprojection(xy, xyz, 1e-6, ("cx",), (prior, Prior("k1", 9.0, 0.1)))
    assert minimize(problem, camera).cost == pytest.approx(1, rel=1e-4)


def test_points_behind_the_camera_are_nan_with_zero_derivative():
    """They neither pull nor crash."""
    camera, xyz, xy = scene(())
    xyz[0] = camera.center + 2 * (camera.center - 0)
    problem = Reprojection(xy, xyz)
    assert np.isnan(problem.residual(camera)[0]).all()
    assert (problem.jacobian(camera)[0] == 0).all()
