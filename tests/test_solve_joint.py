"""The joint problem: ties through the surface, anchors, and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.solve.joint import Anchors, JointPoses, Lenses, Ties, scaled_focal
from texproj.solve.lm import minimize

LENSES = Lenses(np.array([0, 1, 0]), np.log([700.0, 700.0]), 0.01, np.array([True, True]))
SIGMA_PX = np.array([0.5, 0.25, 1.5])
LENS = Intrinsics(800, 600, 700, 705, 390, 310, (-0.1, 0.03, 1e-3, -5e-4, 0))


def three_cameras() -> tuple[Camera, ...]:
    """Three cameras that look at a bumpy patch around the origin from different sides."""
    centers = [(-1.5, -0.3, -4), (0.2, 0.4, -4.3), (1.8, -0.1, -3.8)]
    return tuple(Camera(LENS, Pose.look_at(c, (0, 0, 0), (0, -1, 0))) for c in centers)


def surface(rng, n):
    """(n, 3) points and normals of z = 0.3 sin(2x) cos(2y)."""
    x, y = rng.uniform(-0.9, 0.9, (2, n))
    z = 0.3 * np.sin(2 * x) * np.cos(2 * y)
    slope_x = 0.6 * np.cos(2 * x) * np.cos(2 * y)
    slope_y = -0.6 * np.sin(2 * x) * np.sin(2 * y)
    normal = np.stack([slope_x, slope_y, -np.ones(n)], axis=1)
    return np.stack([x, y, z], axis=1), normal / np.linalg.norm(normal, axis=1, keepdims=True)


def ties_between(cameras, rng, n=60, noise_px=0.0) -> Ties:
    """Ties of all ordered pairs at the true cameras."""
    parts = []
    for i in range(len(cameras)):
        for j in range(len(cameras)):
            if i != j:
                xyz, normal = surface(rng, n)
                px = cameras[i].project(xyz)[0] + rng.normal(0, noise_px, (n, 2))
                ray = cameras[j].pose.apply(xyz)
                ideal, focal = ray[:, :2] / ray[:, 2:], np.full(n, LENS.fx)
                parts.append(Ties(np.full(n, i), np.full(n, j), px, ideal, focal, xyz, normal))
    return Ties.joined(parts)


def anchored(cameras, rng, sigma_px=1.0) -> Anchors:
    """Each camera remembers where it saw 20 points."""
    xyz, _ = surface(rng, 20)
    px = np.concatenate([c.project(xyz)[0] for c in cameras])
    number = np.repeat(np.arange(len(cameras)), 20)
    return Anchors(number, np.tile(xyz, (len(cameras), 1)), px, np.full(len(number), sigma_px))


def problem(cameras, rng, noise_px=0.0, fixed=(False, False, False)) -> JointPoses:
    ties = ties_between(cameras, rng, noise_px=noise_px)
    return JointPoses(ties, anchored(cameras, rng), LENSES, SIGMA_PX, np.array(fixed))


def test_the_residual_is_zero_at_the_truth():
    """Rays of one camera meet the surface where the other sees it."""
    cameras = three_cameras()
    joint = problem(cameras, np.random.default_rng(1))

    assert np.abs(joint.residual(cameras)).max() < 1e-9
    assert np.abs(joint.prior(cameras)[0]).max() < 1e-9


@pytest.mark.parametrize("which", ["residual", "prior"])
def test_derivatives_are_those_of_central_differences(which):
    """Also away from the truth, for both cameras of a tie."""
    cameras = three_cameras()
    joint = problem(cameras, np.random.default_rng(2))
    cameras = joint.step(cameras, np.random.default_rng(3).normal(0, 0.01, 20))
    told = joint.jacobian(cameras) if which == "residual" else joint.prior(cameras)[1]
    value = (lambda c: joint.residual(c).ravel()) if which == "residual" else (
        lambda c: joint.prior(c)[0])  # fmt: skip
    h = 1e-6
    columns = [
        (value(joint.step(cameras, h * e)) - value(joint.step(cameras, -h * e))) / (2 * h)
        for e in np.eye(20)
    ]

    assert np.abs(told.toarray() - np.stack(columns, axis=1)).max() < 1e-3 * np.abs(told).max()
    assert np.abs(told.toarray() - np.stack(columns, axis=1)).max() < 1e-4 * 800


def test_each_photo_has_its_own_noise():
    """A pixel off counts for one over that photo's noise, whatever the others' is."""
    cameras = three_cameras()
    joint = problem(cameras, np.random.default_rng(1))
    shifted = replace(joint.ties, to_px=joint.ties.to_px + np.array([1.0, 0.0]))
    off = -replace(joint, ties=shifted).residual(cameras)[:, 0]

    assert off == pytest.approx(1 / SIGMA_PX[joint.ties.to])


def test_cameras_that_are_fixed_do_not_move_and_lead_the_others():
    """Two of three held at the truth bring the third back from 10 pixels, exactly."""
    truth = three_cameras()
    rng = np.random.default_rng(4)
    known = Lenses(LENSES.group, LENSES.log_focal, 0.01, np.array([False, False]))
    joint = replace(problem(truth, rng, fixed=(True, True, False)), lenses=known)
    moved = truth[2].pose.step([0.01, -0.008, 0.01, 0.02, 0.01, -0.03])
    start = (truth[0], truth[1], Camera(LENS, moved))
    found = minimize(joint, start).x

    assert found[0].pose is truth[0].pose and found[1].pose is truth[1].pose
    assert np.abs(found[2].pose.R - truth[2].pose.R).max() < 1e-6
    assert np.abs(found[2].pose.t - truth[2].pose.t).max() < 1e-5


def test_a_shared_focal_length_is_found():
    """Two cameras of one lens, both 1 % long: ties across the relief bring the length back."""
    truth = three_cameras()
    joint = problem(truth, np.random.default_rng(8))
    longer = scaled_focal(LENS, 1.01)
    start = (Camera(longer, truth[0].pose), truth[1], Camera(longer, truth[2].pose))
    found = minimize(joint, start).x

    assert found[0].intrinsics.fx == found[2].intrinsics.fx
    assert abs(found[0].intrinsics.fx / LENS.fx - 1) < 1e-4


def test_noise_of_the_ties_shows_in_the_cameras_and_no_more():
    """With 0.5 px noise on 360 ties the surface is off by a tenth of a pixel, not by nothing."""
    truth = three_cameras()
    joint = problem(truth, np.random.default_rng(5), noise_px=0.5)
    found = minimize(joint, truth).x
    xyz, _ = surface(np.random.default_rng(6), 200)
    error = [np.linalg.norm(a.project(xyz)[0] - b.project(xyz)[0], axis=1).mean()
             for a, b in zip(found, truth, strict=True)]  # fmt: skip

    assert 0.005 < np.mean(error) < 0.3
