"""The joint problem: ties through the surface, anchors, and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.solve.joint import Anchors, JointPoses, Ties
from texproj.solve.lm import minimize
from texproj.solve.reprojection import intrinsic_step
from texproj.solve.shared_lens import LensParameters, SharedIntrinsics, ideal_of

SIGMA_PX = np.array([0.5, 0.25, 1.5])
LENS = Intrinsics(800, 600, 700, 705, 390, 310, (-0.1, 0.03, 1e-3, -5e-4, 0))
GROUP = np.array([0, 1, 0])
"""The first and the third photo share a lens."""


def lenses(*free: str) -> LensParameters:
    """The true lens is known beforehand, to a percent or so; what is named is solved."""
    radial = ("focal", "k1", "k2"), (np.log(LENS.fx), -0.1, 0.03), (0.01, 0.01, 0.01)
    central = ("cx", "cy", "aspect"), (390.0, 310.0, np.log(705 / 700)), (8.0, 8.0, 0.01)
    return LensParameters(tuple(
        SharedIntrinsics(
            names, GROUP, np.tile(value, (2, 1)), np.tile(sigma, (2, 1)),
            np.tile([name in free for name in names], (2, 1)),
        )
        for names, value, sigma in (radial, central)
    ))  # fmt: skip


ALL = lenses("focal", "k1", "k2", "cx", "cy", "aspect")


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
                source, ideal = cameras[j].project(xyz)[0], ray[:, :2] / ray[:, 2:]
                parts.append(Ties(np.full(n, i), np.full(n, j), px, source, ideal, xyz, normal))
    return Ties.joined(parts)


def anchored(cameras, rng, sigma_px=1.0) -> Anchors:
    """Each camera remembers where it saw 20 points."""
    xyz, _ = surface(rng, 20)
    px = np.concatenate([c.project(xyz)[0] for c in cameras])
    number = np.repeat(np.arange(len(cameras)), 20)
    return Anchors(number, np.tile(xyz, (len(cameras), 1)), px, np.full(len(number), sigma_px))


def problem(cameras, rng, noise_px=0.0, fixed=(False,) * 3, solved=None) -> JointPoses:
    ties = ties_between(cameras, rng, noise_px=noise_px)
    return JointPoses(ties, anchored(cameras, rng), solved or ALL, SIGMA_PX, np.array(fixed))


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
    cameras = joint.step(cameras, np.random.default_rng(3).normal(0, 0.01, 18 + ALL.count))
    told = whole(joint, cameras) if which == "residual" else joint.prior(cameras)[1].toarray()
    value = (lambda c: joint.residual(c).ravel()) if which == "residual" else (
        lambda c: joint.prior(c)[0])  # fmt: skip
    h = 1e-6
    columns = [
        (value(joint.step(cameras, h * e)) - value(joint.step(cameras, -h * e))) / (2 * h)
        for e in np.eye(18 + ALL.count)
    ]

    assert np.abs(told - np.stack(columns, axis=1)).max() < 1e-3 * np.abs(told).max()
    assert np.abs(told - np.stack(columns, axis=1)).max() < 1e-4 * 800


def whole(joint: JointPoses, cameras) -> np.ndarray:
    """(2 n, p) all parts of the jacobian in their rows."""
    out = np.full((len(joint.ties), 2, 6 * len(cameras) + joint.lenses.count), np.nan)
    for part in joint.jacobian(cameras):
        out[part.rows] = 0
        np.add.at(out, (part.rows[:, None], slice(None), part.columns), part.block.swapaxes(1, 2))
    return out.reshape(2 * len(joint.ties), -1)


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
    joint = problem(truth, rng, fixed=(True, True, False), solved=lenses())
    moved = truth[2].pose.step([0.01, -0.008, 0.01, 0.02, 0.01, -0.03])
    start = (truth[0], truth[1], Camera(LENS, moved))
    found = minimize(joint, start).x

    assert found[0].pose is truth[0].pose and found[1].pose is truth[1].pose
    assert np.abs(found[2].pose.R - truth[2].pose.R).max() < 1e-6
    assert np.abs(found[2].pose.t - truth[2].pose.t).max() < 1e-5


def relensed(cameras, **change):
    """The cameras of the shared lens with another one, the second as it is."""
    lens = LENS
    for name, value in change.items():
        lens = intrinsic_step(lens, name, value)
    first, second, third = cameras
    return Camera(lens, first.pose), second, Camera(lens, third.pose)


def test_a_shared_lens_is_found():
    """Two cameras of one lens, 1 % long, off center and bent: ties across the relief bring it all
    back, and the same for both.
    """
    truth = three_cameras()
    joint = problem(truth, np.random.default_rng(8), solved=ALL)
    start = relensed(truth, focal=0.01, cx=4.0, cy=-3.0, k1=0.01, k2=-0.01)
    found = [camera.intrinsics for camera in minimize(joint, start).x]

    assert found[0] == found[2]
    assert abs(found[0].fx / LENS.fx - 1) < 1e-4
    assert abs(found[0].cx - LENS.cx) < 0.05 and abs(found[0].cy - LENS.cy) < 0.05
    assert np.abs(np.subtract(found[0].dist[:2], LENS.dist[:2])).max() < 1e-3


def test_what_is_not_solved_stays():
    """Of a lens whose focal length alone is free nothing else moves."""
    truth = three_cameras()
    joint = problem(truth, np.random.default_rng(8), noise_px=0.1, solved=lenses("focal"))
    found = minimize(joint, relensed(truth, focal=0.01)).x[0].intrinsics

    assert abs(found.fx / LENS.fx - 1) < 2e-3
    assert (found.cx, found.cy, found.dist) == (LENS.cx, LENS.cy, LENS.dist)


def test_the_ray_of_a_pixel_follows_the_lens():
    """From the ray of a lens that differs by a percent, as exactly as without a guess."""
    ideal = np.random.default_rng(9).uniform(-0.5, 0.5, (200, 2))
    lens = relensed(three_cameras(), focal=0.01, cx=4.0, k1=0.01)[0].intrinsics
    px = lens.distort(ideal) * (lens.fx, lens.fy) + (lens.cx, lens.cy)
    guess = LENS.undistort((px - (LENS.cx, LENS.cy)) / (LENS.fx, LENS.fy))

    assert np.abs(ideal_of(lens, px, guess) - ideal).max() * LENS.fx < 1e-3


def test_noise_of_the_ties_shows_in_the_cameras_and_no_more():
    """With 0.5 px noise on 360 ties the surface is off by a tenth of a pixel, not by nothing."""
    truth = three_cameras()
    joint = problem(truth, np.random.default_rng(5), noise_px=0.5)
    found = minimize(joint, truth).x
    xyz, _ = surface(np.random.default_rng(6), 200)
    error = [np.linalg.norm(a.project(xyz)[0] - b.project(xyz)[0], axis=1).mean()
             for a, b in zip(found, truth, strict=True)]  # fmt: skip

    assert 0.005 < np.mean(error) < 0.3
