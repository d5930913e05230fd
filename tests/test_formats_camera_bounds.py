"""Which cameras a file may state, and how the others are refused."""

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError
from texproj.formats.camera_bounds import checked_intrinsics, checked_pose, checked_rotation

SOUND = {"width": 640, "height": 480, "focal": (500, 501), "center": (320, 240), "dist": (0,) * 5}


def made(**changes):
    return checked_intrinsics(**(SOUND | changes), where="a.json, photo 1")


def test_a_sound_camera_comes_back_bit_for_bit():
    """Numbers of any type; one focal length stands for both."""
    given = made(width=640.0, dist=(0.1, -0.02, 1e-3, 2e-3, 3e-3))
    assert given == Intrinsics(640, 480, 500, 501, 320, 240, (0.1, -0.02, 1e-3, 2e-3, 3e-3))
    assert made(focal=500).fy == 500


REFUSED = {
    "width": [0, -1, 1e12, 1e300, 0.5, float("nan"), "wide", None, [1, 2], 10**400],
    "height": [0, 200_001],
    "focal": [0, -500, 1e-3, 1e308, (500, 0), (1, 2, 3), float("inf"), "f", ()],
    "center": [(1e6, 240), (320, -1e308), (320,), 320, ("x", 1), None],
    "dist": [(1e200, 0, 0, 0), (0, 0, 0, 0, 1e9), (1, 2, 3), (0,) * 13 + (3,), [[0], [1, 2]], "k"],
}


@pytest.mark.parametrize(("key", "value"), [(k, v) for k, vs in REFUSED.items() for v in vs])
def test_what_no_camera_has_is_refused_with_place_and_key(key, value):
    """Each in one sentence that names the key."""
    says = {"focal": "focal length", "center": "principal point"}.get(key, key)
    with pytest.raises(InputError, match=rf"^a\.json, photo 1: .*{says}") as error:
        made(**{key: value})
    assert len(str(error.value)) < 200


@pytest.mark.parametrize(
    "R",
    [np.zeros((3, 3)), np.eye(3) * 2, np.diag([1, 1, -1]), np.full((3, 3), 1e200), np.eye(2),
     np.full((3, 3), np.nan), np.full((3, 3), 1e-320), "R", None, [[1, 0, 0], [0, 1], [0, 0, 1]]],
)  # fmt: skip
def test_what_is_no_rotation_is_refused(R):
    with pytest.raises(InputError, match="p: R"):
        checked_rotation(R, "p")


def test_rotations_are_kept_within_the_printing_of_four_digits():
    """No bit changes; a tenth of a degree of shear is too much."""
    R = np.round(Pose.look_at((3, 2, 1), (0, 0, 0)).R, 4)
    np.testing.assert_array_equal(checked_rotation(R, "p"), R)
    with pytest.raises(InputError, match="not a rotation"):
        checked_rotation(R + 0.002 * np.eye(3), "p")


@pytest.mark.parametrize("t", [(0, 0, 1e16), (0, 0, -1e200), (1, 2), "t", (0, 0, np.inf)])
def test_translations_beyond_double_precision_are_refused(t):
    with pytest.raises(InputError, match="p: t"):
        checked_pose(np.eye(3), t, "p")


@pytest.mark.parametrize("k", [1e-320, 1e-308, 5e-324, -1e-300])
@pytest.mark.parametrize("at", range(8))
def test_subnormal_coefficients_are_as_good_as_none(k, at):
    """The domain of the lens is unbounded, and points fall where they fall without it."""
    dist = [0.0] * 8
    dist[at] = k
    camera = Camera(made(dist=dist), Pose(np.eye(3), np.zeros(3)))
    plain = Camera(made(), camera.pose)
    assert camera.intrinsics.max_radius == np.inf
    xyz = np.array([[0.1, 0.2, 1], [3, -1, 1.0]])
    np.testing.assert_array_equal(camera.project(xyz)[0], plain.project(xyz)[0])
    xy = np.array([[10.0, 20], [600, 400]])
    np.testing.assert_allclose(camera.rays(xy)[1], plain.rays(xy)[1], atol=1e-12)


@pytest.mark.parametrize("k", [1e70, 1e200, 1e308])
def test_nothing_is_seen_through_an_impossible_lens(k):
    """Solvers may try any number: the answer is a value, neither an error nor for ever."""
    lens = Intrinsics(640, 480, 500, 500, 320, 240, (k, -k, 0, 0, k))
    assert lens.max_radius == 0
    assert np.isnan(lens.distort([[0.1, 0.2]])).all()
    assert np.isnan(lens.undistort([[0.1, 0.2]])).all()
