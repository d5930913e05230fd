"""A placed block adjusted at once with its tracks, the mesh and what is said of its photos."""

from dataclasses import replace

import numpy as np
import pytest
from block_errors import offsets_px
from test_block_anchor import LENS, moved, scene  # noqa: F401 - a fixture

from texproj.photo import Correspondences
from texproj.register.block.anchor import anchored
from texproj.register.block.bundle import bundled
from texproj.register.block.confirmation import Confirmation
from texproj.register.block.held_block import held_block
from texproj.register.block.said import by_camera, by_place, seen_on_mesh
from texproj.register.block.scan_samples import ScanSamples


@pytest.fixture(scope="module")
def samples(scene):  # noqa: F811
    return ScanSamples.of(scene.mesh)


def errors_px(scene, cameras):  # noqa: F811
    """(photos,) median distance of the mesh's images by true and by found cameras."""
    pairs = zip(cameras, scene.cameras.values(), strict=True)
    return np.array([np.median(offsets_px(a, b, scene.mesh.vertices[::7])) for a, b in pairs])


def off(camera, px, rng):
    """The camera turned and shifted so that what it sees moves by about so many pixels."""
    turn = px / camera.intrinsics.fx / np.sqrt(3) * rng.normal(size=3)
    return replace(camera, pose=camera.pose.step([*turn, 0, 0, 0]))


def held(scene, samples, anchors, **known):  # noqa: F811
    asked = Confirmation(0.0, None, np.inf, np.inf, samples=samples)
    return held_block(scene.block, anchored(scene.block, anchors), anchors, asked, **known)


def test_a_wrong_lens_of_the_block_is_corrected(scene, samples):  # noqa: F811
    """A focal length that is 1 % off, as of photos of a flat thing: the mesh tells."""
    long = replace(LENS, fx=1.01 * LENS.fx, fy=1.01 * LENS.fy)
    cameras = [replace(camera, intrinsics=long) for camera in scene.cameras.values()]
    points = scene.world_from_block.apply(scene.block.points)
    said = by_place(scene.block, cameras, [6.0] * 5, seen_on_mesh(scene.block, points, samples))
    found = bundled(scene.block, cameras, points, samples, said)

    assert errors_px(scene, cameras).min() > 3
    assert errors_px(scene, found.cameras).max() < 1
    assert found.cameras[0].intrinsics.fx == pytest.approx(1300, rel=2e-3)
    assert 0.6 < found.on_surface < 1
    assert 0.1 < np.median(errors_px(scene, found.cameras) / found.expected_error_px) < 2


def test_one_wrong_registration_of_three_is_named_and_counted_out(scene, samples):  # noqa: F811
    """It is 4 pixels off and claims half of one: too little to contradict the block's shape."""
    rng = np.random.default_rng(2)
    cameras = {name: off(scene.cameras[name], 0.4, rng) for name in ("0.jpg", "2.jpg")}
    cameras["4.jpg"] = moved(scene.cameras["4.jpg"], (0.13, 0.13, 0.0), (0, 0, 0))
    anchors = [scene.anchor(name, camera, 0.5) for name, camera in cameras.items()]
    found = held(scene, samples, anchors)

    gap = offsets_px(cameras["4.jpg"], scene.cameras["4.jpg"], scene.mesh.vertices[::7])
    assert 3 < np.median(gap) < 5
    assert anchored(scene.block, anchors).contradicts == ()
    assert found.contradicts == ("4.jpg",)
    assert errors_px(scene, found.cameras).max() < 1


def test_picks_count_by_their_noise(scene, samples):  # noqa: F811
    """Picks in one photo, exact, and a camera of another that is off by 4 pixels and says so."""
    rng = np.random.default_rng(4)
    xyz = scene.mesh.vertices[rng.permutation(len(scene.mesh.vertices))[:400]]
    px = scene.cameras["1.jpg"].project(xyz)[0]
    inside = np.flatnonzero(scene.cameras["1.jpg"].inside(px))[:12]
    picks = Correspondences(px[inside] + rng.normal(0, 0.5, (12, 2)), xyz[inside])
    rough = off(scene.cameras["4.jpg"], 4.0, rng)
    anchors = [
        replace(scene.anchor("1.jpg"), picks=picks, pick_sigma_px=0.5),
        scene.anchor("4.jpg", rough, 4.0),
    ]
    found = held(scene, samples, anchors)

    assert found.contradicts == ()
    assert errors_px(scene, found.cameras).max() < 1


def test_two_that_contradict_each_other_are_not_told_apart(scene, samples):  # noqa: F811
    """The error that is expected says so instead."""
    points = scene.world_from_block.apply(scene.block.points)
    seen = seen_on_mesh(scene.block, points, samples)
    anchors = [scene.anchor("0.jpg", expected=0.3)]
    anchors.append(
        scene.anchor("4.jpg", moved(scene.cameras["4.jpg"], (0.13, 0.13, 0.0), (0, 0, 0)), 0.3)
    )
    found = held(scene, samples, anchors)

    assert len(by_camera("4.jpg", scene.cameras["4.jpg"], 0.3, seen[4]).px) > 10
    assert len(found.contradicts) < 2
    assert (found.expected_error_px > errors_px(scene, found.cameras) / 3).all()
