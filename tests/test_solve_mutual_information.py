"""Mutual information and camera steps on examples whose answers are known on paper."""

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.solve.mutual_information import (
    binned,
    entropy_bits,
    joint_histogram,
    mutual_information_bits,
    normalized_mutual_information,
)
from texproj.solve.pose_search import CameraSteps, curvature, maximize

CAMERA = Camera(Intrinsics(400, 300, 500, 500, 210, 140), Pose.look_at((3, -4, 2), (0.2, 0.1, 0.3)))
POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (300, 3))


def shared_information(a, b, bins, mask=None) -> float:
    """Mutual information, bits, of two images with values in 0..1; mask: weight of each pixel."""
    return mutual_information_bits(joint_histogram(binned(a, bins), binned(b, bins), mask))


def test_equal_images_share_their_entropy():
    """Four equally frequent values tell 2 bits about themselves."""
    image = np.tile(np.arange(4) / 3, 25)
    assert shared_information(image, image, bins=4) == pytest.approx(2, abs=1e-12)


def test_any_one_to_one_relation_counts_fully():
    """Values exchanged against each other are as informative as equal ones."""
    image = np.tile(np.arange(4) / 3, 25)
    other = np.array([2, 0, 3, 1])[np.tile(np.arange(4), 25)] / 3
    assert shared_information(image, other, bins=4) == pytest.approx(2, abs=1e-12)


def test_independent_images_share_nothing():
    """A product of two distributions has no mutual information."""
    a, b = np.meshgrid(np.arange(4) / 3, np.arange(5) / 4)
    joint = joint_histogram(binned(a, 4), binned(b, 5))
    assert mutual_information_bits(joint) == pytest.approx(0, abs=1e-12)
    assert normalized_mutual_information(joint) == pytest.approx(1, abs=1e-12)


def test_a_table_worked_out_by_hand():
    """p = (1/2, 1/4; 0, 1/4): H = .8113, .9544 ... I = H(a) + H(b) - 1.5 bits = 0.3113."""
    joint = np.array([[2.0, 1.0], [0.0, 1.0]])
    row, column = entropy_bits([3, 1]), entropy_bits([2, 2])
    assert row == pytest.approx(0.811278, abs=1e-6)
    assert mutual_information_bits(joint) == pytest.approx(row + column - 1.5, abs=1e-12)
    assert normalized_mutual_information(joint) == pytest.approx((row + column) / 1.5, abs=1e-12)


def test_a_value_between_two_bins_counts_for_both():
    """A quarter of the way from bin 1 to bin 2 gives 3/4 and 1/4."""
    joint = joint_histogram(binned([1.25 / 3], 4), binned([0.0], 2))
    assert joint[:, 0] == pytest.approx([0, 0.75, 0.25, 0])
    assert joint.sum() == pytest.approx(1)


def test_background_does_not_count():
    """Masked pixels change nothing, whatever they hold."""
    rng = np.random.default_rng(1)
    a, b = rng.random((2, 40, 40))
    mask = np.zeros((40, 40))
    mask[10:30, 10:30] = 1
    inside = shared_information(a[10:30, 10:30], b[10:30, 10:30], 8)
    a[mask == 0], b[mask == 0] = 0.9, 0.1
    assert shared_information(a, b, 8, mask) == pytest.approx(inside, abs=1e-12)


@pytest.mark.parametrize("focal", [False, True])
def test_a_step_of_one_moves_the_image_by_at_most_a_pixel(focal):
    """In strong directions by 1 px RMS, in weak ones by less; both on both sides of zero."""
    steps = CameraSteps.around(CAMERA, POINTS, focal)
    before = CAMERA.project(POINTS)[0]
    motion = []
    for axis in 0.1 * np.eye(steps.count):
        gap = steps.at(axis).project(POINTS)[0] - before
        motion.append(10 * np.sqrt((gap**2).sum(1).mean()))
    assert max(motion) == pytest.approx(1, abs=0.01)
    assert sorted(motion)[1] > 0.3  # roll, shift, distance, turns all show in this view
    assert steps.count == 6 + focal


def test_dolly_keeps_the_size():
    """A longer focal length steps back: the middle of the object keeps its magnification."""
    basis = np.eye(7)
    pivot = CAMERA.pose.apply(POINTS).mean(axis=0)
    moved = CameraSteps(CAMERA, pivot, basis).at(np.array([0, 0, 0, 0, 0, 0, 0.1]))
    assert moved.intrinsics.fx == pytest.approx(500 * np.exp(0.1))
    middle = CAMERA.pose.inverse.apply(pivot[None])
    before, after = CAMERA.pose.apply(middle)[0, 2], moved.pose.apply(middle)[0, 2]
    assert moved.intrinsics.fx / after == pytest.approx(500 / before)


def test_pose_delta_is_the_pose_step():
    """The linear map to `Pose.step` agrees with the step itself to second order."""
    steps = CameraSteps.around(CAMERA, POINTS)
    small = 0.1 * np.array([0.2, -0.1, 0.3, 0.1, -0.2, 0.05])
    expected = CAMERA.pose.step(steps.pose_delta() @ small)
    found = steps.at(small).pose
    assert pytest.approx(expected.R, abs=1e-7) == found.R
    assert found.t == pytest.approx(expected.t, abs=1e-5)


def test_the_search_finds_a_peak_and_its_curvature():
    """A paraboloid's top to a tenth of a pixel, and its second derivatives exactly."""
    rng = np.random.default_rng(2)
    A = rng.standard_normal((6, 6))
    H = A @ A.T / 6 + np.eye(6)
    top = rng.uniform(-2, 2, 6)

    def height(x):
        return -0.5 * (x - top) @ H @ (x - top)

    found = maximize(height, 6, first_step=2, last_step=0.01, evaluations=300, reach=10)
    assert found.x == pytest.approx(top, abs=0.1)
    assert found.value > found.initial
    assert curvature(height, 6, 3.0) == pytest.approx(-H, abs=1e-9)
