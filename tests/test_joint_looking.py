"""Where a camera sees many points at once, in single precision."""

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.opencv import FAR_OUTSIDE
from texproj.register.joint.looking import pixels_of

LENSES = {
    "straight": (),
    "radial": (-0.2, 0.05),
    "three radial": (-0.2, 0.05, 0, 0, 0.01),
    "tangential": (-0.2, 0.05, 2e-3, -1e-3, 0),
    "rational": (-0.1, 0.02, 0, 0, 0, 0.1, 0.01, 0),
}


def lens_of(dist) -> Intrinsics:
    return Intrinsics(1536, 1024, 1400, 1390, 770, 505, tuple(dist) + (0.0,) * (4 - len(dist)))


@pytest.mark.parametrize("dist", LENSES.values(), ids=LENSES)
def test_places_are_those_of_the_camera_to_a_thousandth_of_a_pixel(dist):
    """Against the projection in double precision, over the whole picture."""
    rng = np.random.default_rng(0)
    camera = Camera(lens_of(dist), Pose.identity())
    xyz = rng.uniform((-0.55, -0.36, 1), (0.55, 0.36, 1), (2, 700, 3)) * rng.uniform(
        2, 9, (2, 700, 1)
    )
    wanted = camera.project(xyz.reshape(-1, 3))[0].reshape(2, 700, 2) - 0.5
    at = pixels_of(camera.intrinsics, np.ascontiguousarray(np.moveaxis(xyz, -1, 0), np.float32))
    assert at.shape == (2, 2, 700)
    assert at.dtype == np.float32
    assert np.abs(np.moveaxis(at, 0, -1) - wanted).max() < 1e-3


def test_what_is_not_seen_is_far_outside():
    """Behind the camera, in its plane, nowhere, and beyond where the lens model holds."""
    lens = lens_of((-0.4, 0))
    beyond = 1.1 * lens.max_radius
    xyz = np.array([(0, 0, -1), (1, 1, 0), (np.nan, 0, 1), (beyond, 0, 1), (0.1, 0, 1)], np.float32)
    at = pixels_of(lens, np.ascontiguousarray(xyz.T)[:, None])
    assert (at[:, 0, :4] == FAR_OUTSIDE).all()
    assert np.abs(at[:, 0, 4] - (770 + 1400 * 0.1 * (1 - 0.4 * 0.01) - 0.5, 504.5)).max() < 1e-3
