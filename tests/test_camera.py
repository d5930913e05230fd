"""Poses as a group, the lens model and its inverse, and where pixels are."""

import cv2
import numpy as np
import pytest

from texproj.camera import DISTORTION_LENGTHS, Camera, Intrinsics, Pose

COEFFICIENTS = np.array(
    [-0.21, 0.11, 1.2e-3, -7e-4, -0.03, 0.05, 0.02, -0.004, 2e-3, -1e-3, 1.5e-3, 5e-4, 0.01, -0.02]
)
"""k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty of a plausible wide lens."""


def random_pose(rng, distance=3.0):
    axis = rng.normal(size=3)
    return Pose(cv2.Rodrigues(axis)[0], rng.normal(size=3) * distance)


def lens(count=5, **changes):
    values = {
        "width": 4000,
        "height": 3000,
        "fx": 3100.0,
        "fy": 3120.0,
        "cx": 2040.5,
        "cy": 1470.25,
    }
    return Intrinsics(**(values | changes), dist=tuple(COEFFICIENTS[:count]))


def image_grid(k, margin=0.0):
    """(n, 2) pixels over the whole picture, corners included."""
    x = np.linspace(-margin, k.width + margin, 15)
    y = np.linspace(-margin, k.height + margin, 11)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


# --- poses


@pytest.mark.parametrize("seed", range(5))
def test_poses_are_a_group(seed):
    """Identity, inverse and associativity, judged by what they do to points."""
    rng = np.random.default_rng(seed)
    a, b, c = (random_pose(rng) for _ in range(3))
    x = rng.normal(size=(7, 3))
    close = {"rtol": 0, "atol": 1e-12}
    np.testing.assert_allclose((a @ a.inverse).apply(x), x, **close)
    np.testing.assert_allclose((a.inverse @ a).apply(x), x, **close)
    np.testing.assert_allclose((Pose.identity() @ a).apply(x), a.apply(x), **close)
    np.testing.assert_allclose((a @ Pose.identity()).apply(x), a.apply(x), **close)
    np.testing.assert_allclose(((a @ b) @ c).apply(x), (a @ (b @ c)).apply(x), **close)


def test_a_product_reads_right_to_left():
    """First a quarter turn about z, then a step along x."""
    turn = Pose([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [0, 0, 0])
    step = Pose(np.eye(3), [10, 0, 0])
    np.testing.assert_allclose((step @ turn).apply([[1, 0, 0]]), [[10, 1, 0]], atol=1e-15)


def test_the_center_is_where_the_camera_is():
    pose = random_pose(np.random.default_rng(1))
    np.testing.assert_allclose(pose.apply(pose.center[None]), np.zeros((1, 3)), atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-16, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3, 1, 3.14])
def test_a_step_of_any_size_turns_by_its_length(angle):
    """Near the identity too, where sines of zero over zero lurk: the angle comes back."""
    axis = np.array([2.0, -1.0, 2.0]) / 3
    pose = Pose.identity().step([*(angle * axis), 0, 0, 0])
    back = np.array([pose.R[2, 1], pose.R[0, 2], pose.R[1, 0]]) - [
        pose.R[1, 2], pose.R[2, 0], pose.R[0, 1],
    ]  # fmt: skip
    np.testing.assert_allclose(back / 2, np.sin(angle) * axis, rtol=1e-9, atol=3e-16)
    np.testing.assert_allclose(pose.R @ pose.R.T, np.eye(3), rtol=0, atol=1e-15)
    assert np.linalg.det(pose.R) == pytest.approx(1)


def test_a_step_moves_in_camera_axes():
    pose = random_pose(np.random.default_rng(2))
    x = np.array([[0.3, -0.2, 5.0]])
    w, v = np.array([1e-7, -2e-7, 3e-7]), np.array([0.1, 0.2, 0.3])
    before, after = pose.apply(x), pose.step([*w, *v]).apply(x)
    np.testing.assert_allclose(after - before, np.cross(w, before) + v, rtol=0, atol=1e-12)


def test_a_step_there_and_back_is_no_step():
    pose = random_pose(np.random.default_rng(3))
    delta = np.array([0.3, -0.2, 0.1, 0, 0, 0])
    again = pose.step(delta).step(-delta)
    np.testing.assert_allclose(again.R, pose.R, atol=1e-15)
    np.testing.assert_allclose(again.t, pose.t, atol=1e-14)


def test_a_thousand_steps_leave_a_rotation():
    pose = Pose.identity()
    for delta in np.random.default_rng(4).normal(size=(1000, 6)):
        pose = pose.step(delta)
    np.testing.assert_allclose(pose.R @ pose.R.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0), (0.5, -0.5, 0.7)])
def test_look_at_centers_the_target_with_up_upwards(up):
    """Also where the line of sight is `up` itself."""
    k = Intrinsics(200, 100, 150, 150, 100, 50)
    for center in ([3.0, 4.0, 5.0], [0.0, 0.0, 9.0], [0.0, -9.0, 0.0]):
        camera = Camera(k, Pose.look_at(center, [0, 0, 0], up))
        np.testing.assert_allclose(camera.center, center, atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(camera.pose.R), 1)
        xy, depth = camera.project([[0, 0, 0], np.multiply(up, 0.1)])
        np.testing.assert_allclose(xy[0], [100, 50], atol=1e-9)
        assert depth[0] == pytest.approx(np.linalg.norm(center))
        assert xy[1, 1] <= 50 + 1e-9


def test_nouns_cannot_be_edited():
    pose = random_pose(np.random.default_rng(5))
    with pytest.raises(ValueError, match="read-only"):
        pose.R[0, 0] = 2
    with pytest.raises(AttributeError):
        pose.t = np.zeros(3)


# --- the lens


@pytest.mark.parametrize("count", DISTORTION_LENGTHS)
def test_distortion_is_opencvs_shifted_by_half_a_pixel(count):
    """OpenCV's pixel (0, 0) is the center of the first pixel, ours its corner."""
    rng = np.random.default_rng(count)
    k, pose = lens(count), random_pose(rng, 0.3)
    camera = Camera(k, pose)
    xyz = pose.inverse.apply(np.c_[rng.uniform(-1, 1, (50, 2)), rng.uniform(2, 5, 50)])
    opencv_K = k.K - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    expected = cv2.projectPoints(xyz, cv2.Rodrigues(pose.R)[0], pose.t, opencv_K, np.array(k.dist))[
        0
    ].reshape(-1, 2)
    xy, depth = camera.project(xyz)
    np.testing.assert_allclose(xy, expected + 0.5, rtol=0, atol=1e-8)
    np.testing.assert_allclose(depth, pose.apply(xyz)[:, 2])


@pytest.mark.parametrize("count", DISTORTION_LENGTHS)
def test_undistort_inverts_distort_over_the_whole_picture(count):
    """Also a bit beyond its borders."""
    k = lens(count)
    target = (image_grid(k, 100) - (k.cx, k.cy)) / (k.fx, k.fy)
    ideal = k.undistort(target)
    assert np.isfinite(ideal).all()
    np.testing.assert_allclose(k.distort(ideal), target, rtol=0, atol=1e-9)


PRISM = (0.1, -0.05, 0.001, 0.002, 0.01, 0.02, -0.01, 0.003, 0.01, -0.02, 0.015, 0.005)


@pytest.mark.parametrize("dist", [PRISM, (*PRISM, 0.05, -0.08)], ids=["thin prism", "tilt"])
def test_pixels_go_out_and_come_back_through_prism_and_tilt(dist):
    """To a billionth of a pixel, all over the picture, at any depth; forth by OpenCV's own hand."""
    k = Intrinsics(3000, 2000, 2000, 2010, 1510, 990, dist)
    camera = Camera(k, Pose.look_at((1, 2, 3), (0, 0, 0)))
    rng = np.random.default_rng(0)
    xy = rng.random((500, 2)) * (3000, 2000)
    xyz = camera.unproject(xy, rng.uniform(1, 9, 500))
    turn = cv2.Rodrigues(camera.pose.R)[0]
    by_opencv = cv2.projectPoints(xyz, turn, camera.pose.t, k.K, np.array(dist))[0][:, 0]
    assert np.abs(camera.project(xyz)[0] - xy).max() < 1e-9
    assert np.abs(by_opencv - xy).max() < 1e-9


@pytest.mark.parametrize("dist", [(-0.35, 0.1, 0, 0, 0), (0.6, 0, 0, 0, 0), (-0.28, 0.09, 0, 0)])
def test_undistort_converges_where_a_fixed_point_iteration_does_not(dist):
    """Strong barrel and pincushion, up to the edge of the domain."""
    k = Intrinsics(100, 100, 50, 50, 50, 50, dist)
    radius = np.linspace(0, min(k.max_radius * 0.999, 1.4), 60)
    angle = np.linspace(0, 40, 60)
    ideal = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    np.testing.assert_allclose(k.undistort(k.distort(ideal)), ideal, rtol=0, atol=1e-6)


def test_the_domain_ends_where_the_radius_folds_back():
    """r (1 + k1 r^2) grows up to r = 1 / sqrt(-3 k1), the answer on paper."""
    k1 = -0.3
    k = Intrinsics(100, 100, 50, 50, 50, 50, (k1, 0, 0, 0, 0))
    limit = 1 / np.sqrt(-3 * k1)
    assert k.max_radius == pytest.approx(limit, rel=1e-12)
    inside, outside = k.distort([[limit * 0.999, 0], [limit * 1.001, 0]])
    assert np.isfinite(inside).all()
    assert np.isnan(outside).all()
    folded = limit * (1 + k1 * limit**2)
    back = k.undistort([[folded * 0.999, 0], [folded * 1.001, 0]])
    assert back[0, 0] < limit
    assert np.isnan(back[1]).all()


def test_the_domain_of_a_rational_lens_ends_before_its_pole():
    """1 / (1 - r^2 / 4) grows without end towards r = 2."""
    k = Intrinsics(100, 100, 50, 50, 50, 50, (0, 0, 0, 0, 0, -0.25, 0, 0))
    assert k.max_radius == pytest.approx(2)
    assert np.isfinite(k.distort([[1.999, 0]])).all()
    assert np.isnan(k.distort([[2.001, 0]])).all()


def test_a_growing_lens_has_no_limit_and_no_lens_changes_nothing():
    assert Intrinsics(9, 9, 9, 9, 4, 4, (0.1, 0.05, 0, 0, 0)).max_radius == np.inf
    plain = Intrinsics(9, 9, 9, 9, 4, 4)
    xy = np.random.default_rng(0).normal(size=(5, 2)) * 100
    np.testing.assert_array_equal(plain.distort(xy), xy)
    np.testing.assert_array_equal(plain.undistort(xy), xy)
    assert plain.max_radius == np.inf
    assert not plain.distorted


@pytest.mark.parametrize("dist", [(), tuple(COEFFICIENTS[:5])], ids=["pinhole", "lens"])
def test_no_points_are_no_points(dist):
    k = Intrinsics(9, 9, 9, 9, 4, 4, dist)
    camera = Camera(k, Pose.identity())
    assert k.distort(np.zeros((0, 2))).shape == (0, 2)
    assert k.undistort(np.zeros((0, 2))).shape == (0, 2)
    assert camera.project(np.zeros((0, 3)))[0].shape == (0, 2)
    assert camera.unproject(np.zeros((0, 2)), np.zeros(0)).shape == (0, 3)
    assert camera.rays(np.zeros((0, 2)))[1].shape == (0, 3)


# --- cameras


@pytest.mark.parametrize("count", DISTORTION_LENGTHS)
def test_unproject_inverts_project(count):
    rng = np.random.default_rng(count)
    camera = Camera(lens(count), random_pose(rng))
    xy = image_grid(camera.intrinsics)
    depth = rng.uniform(0.5, 20, len(xy))
    again, z = camera.project(camera.unproject(xy, depth))
    np.testing.assert_allclose(again, xy, rtol=0, atol=1e-5)
    np.testing.assert_allclose(z, depth, rtol=1e-12)


def test_rays_start_at_the_center_and_meet_what_the_pixel_sees():
    camera = Camera(lens(8), random_pose(np.random.default_rng(6)))
    xy = image_grid(camera.intrinsics)
    origins, directions = camera.rays(xy)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    np.testing.assert_allclose(origins, np.broadcast_to(camera.center, origins.shape))
    again, depth = camera.project(origins + 3.7 * directions)
    assert (depth > 0).all()
    np.testing.assert_allclose(again, xy, rtol=0, atol=1e-5)


def test_what_is_behind_has_no_pixel():
    camera = Camera(lens(0), Pose.identity())
    xy, depth = camera.project([[0, 0, -1], [0, 0, 0], [0, 0, 1]])
    assert np.isnan(xy[:2]).all()
    np.testing.assert_array_equal(depth, [-1, 0, 1])
    np.testing.assert_array_equal(xy[2], [2040.5, 1470.25])


def test_the_picture_ends_at_its_borders():
    """The first pixel's corner is inside, the last one's far corner is not; NaN never is."""
    camera = Camera(lens(0), Pose.identity())
    xy = [[0, 0], [3999.999, 2999.999], [4000, 10], [10, 3000], [-1e-9, 5], [np.nan, 5]]
    np.testing.assert_array_equal(camera.inside(xy), [True, True, False, False, False, False])


@pytest.mark.parametrize(("width", "height"), [(2000, 1500), (1000, 900), (7, 5), (8000, 6000)])
def test_a_resized_camera_sees_the_same_at_the_same_fraction_of_the_picture(width, height):
    rng = np.random.default_rng(8)
    camera = Camera(lens(5), Pose.identity())
    small = camera.resized(width, height)
    xyz = np.c_[rng.uniform(-1, 1, (20, 2)), np.full(20, 3.0)]
    size, small_size = (4000, 3000), (width, height)
    np.testing.assert_allclose(
        small.project(xyz)[0] / small_size, camera.project(xyz)[0] / size, rtol=0, atol=1e-12
    )


def test_scaled_keeps_the_whole_picture_though_sizes_are_rounded():
    k = Intrinsics(1001, 667, 900, 900, 500.5, 333.5).scaled(0.1)
    assert (k.width, k.height) == (100, 67)
    assert k.cx == pytest.approx(50)
    assert k.cy == pytest.approx(33.5)


BAD_INTRINSICS = {
    "three coefficients": ({"dist": (1, 2, 3)}, "3 coefficients"),
    "negative focal": ({"fx": -5}, "positive focal"),
    "nan": ({"cx": float("nan")}, "finite"),
    "infinite k": ({"dist": (float("inf"), 0, 0, 0)}, "finite"),
    "no pixels": ({"width": 0}, "at least one pixel"),
}


@pytest.mark.parametrize(("change", "says"), BAD_INTRINSICS.values(), ids=BAD_INTRINSICS.keys())
def test_impossible_intrinsics_are_refused(change, says):
    values = {"width": 10, "height": 10, "fx": 9, "fy": 9, "cx": 5, "cy": 5, "dist": ()}
    with pytest.raises(ValueError, match=says):
        Intrinsics(**(values | change))
