"""Registration by other photos: what is found, how exactly, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import exposure_round, synthetic_pair

from texproj.errors import RegistrationError
from texproj.options import RenderOptions
from texproj.photo import Correspondences
from texproj.register.features import Known, inherited_error, pairs_with, register_pairs
from texproj.render import open_renderer
from texproj.solve.features import Features, find_features, match_features


def registered(info, features, known, prior):
    """The camera of a photo from what it shares with the known ones."""
    found = [pairs_with(features, other) for other in known]
    errors = [other.expected_error_px for other in known]
    return register_pairs(info, found, inherited_error(found, errors, [False] * len(found)), prior)


@pytest.fixture(scope="module")
def known():
    """Three registered photos of the painted stele, with their truth, and the whole scene."""
    data = exposure_round()
    with open_renderer(RenderOptions()) as renderer, renderer.load(data.mesh) as scene:
        found = [
            Known(data.cameras[k], find_features(data.photos[k].gray()),
                  scene.gbuffer(data.cameras[k], ("depth",)).depth, 0.5)
            for k in (0, 3, 4)
        ]  # fmt: skip
    return data, found


def test_a_photo_without_any_start_is_registered_by_others(known):
    """No picks, no pose, no calibration but EXIF: within a pixel or so of the truth."""
    data, others = known
    info, camera = replace(data.photos[1].info, focal_px=None), data.cameras[1]
    fit = registered(info, find_features(data.photos[1].gray()), others, camera.intrinsics)
    xyz = data.mesh.vertices[::20]
    apart = np.linalg.norm(fit.camera.project(xyz)[0] - camera.project(xyz)[0], axis=1)

    assert fit.accepted and fit.method == "features"
    assert np.nanmean(apart) < 0.003 * camera.width
    assert np.nanmean(apart) < 3 * fit.expected_error_px
    assert fit.expected_error_px >= 0.5


def test_a_photo_of_something_else_is_refused(known):
    """Another piece of the same stone: nothing in it is what the others show."""
    _, others = known
    foreign = synthetic_pair(1, "capital", seed=3, long_side=720).photos[0]
    with pytest.raises(RegistrationError, match="pick 8 points"):
        fit = registered(foreign.info, find_features(foreign.gray()), others, None)
        if not fit.accepted:
            raise RegistrationError(fit.reason)


def test_errors_of_picks_average_out_and_those_that_all_share_do_not():
    """Each photo counts by how much is shared with it."""
    ten, none = Correspondences(np.zeros((10, 2)), np.zeros((10, 3))), Correspondences([], [])
    four, px = [ten] * 4, [2.0] * 4

    assert inherited_error(four, px, [True] * 4) == pytest.approx(1.0)
    assert inherited_error(four, px, [False] * 4) == pytest.approx(2.0)
    assert inherited_error([ten, none], [1.0, 9.0], [True, False]) == pytest.approx(1.0)


def test_features_are_where_they_are():
    """A dark blob's feature lies at its center, in pixels that count from the corner."""
    y, x = np.mgrid[0:120, 0:160] + 0.5
    gray = 0.8 - 0.6 * np.exp(-((x - 70.25) ** 2 + (y - 50.75) ** 2) / (2 * 6**2))
    features = find_features(gray.astype(np.float32))
    distance = np.linalg.norm(features.xy_px - (70.25, 50.75), axis=1)

    assert distance.min() < 0.1


def test_only_mutual_and_clear_matches_count():
    """Two equal descriptors in one photo are no clear match for a third."""
    rng = np.random.default_rng(1)
    d = rng.random((4, 128)).astype(np.float32)
    a = Features(np.zeros((2, 2)), d[:2])
    b = Features(np.zeros((3, 2)), np.stack([d[0], d[1], d[1]]))

    assert match_features(a, b).tolist() == [[0, 0]]
