"""A block of photos and what is registered of it: where the block is, how sure, and what is
refused.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from block_errors import offsets_px

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.options import RenderOptions
from texproj.register.block.anchor import Anchor, anchored
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.similarity import Similarity
from texproj.render import open_renderer

LENS = Intrinsics(1200, 800, 1300.0, 1300.0, 620.0, 390.0, (-0.08, 0.02, 0.0, 0.0, 0.0))
PLACES = (
    (-1.2, -2.6, 1.5),
    (-0.5, -3.0, 1.0),
    (0.2, -2.8, 1.8),
    (0.9, -3.1, 1.2),
    (1.5, -2.4, 1.6),
)


def height(x, y):
    """A relief: waves of several lengths."""
    return 0.15 * np.sin(3 * x) * np.cos(2 * y) + 0.05 * np.sin(9 * x + 4 * y) + 0.1 * y


def relief() -> Mesh:
    """The relief as triangles, seen from y = -3, up is z."""
    n = 90
    x, z = (c.ravel() for c in np.meshgrid(np.linspace(-1.5, 1.5, n), np.linspace(0, 2.4, n)))
    k = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + n], 1), np.stack([k + 1, k + n + 1, k + n], 1)])
    return Mesh(np.stack([x, -height(x, z), z], 1), faces.astype(np.int32))


@dataclass(frozen=True)
class Scene:
    """What is true, and what is found: the block in a frame of its own, a renderer's scene."""

    mesh: Mesh
    scan: object
    cameras: dict[str, Camera]
    block: Reconstruction
    world_from_block: Similarity

    def anchor(self, name, camera=None, expected=0.5):
        """One photo of the block with the camera it is registered with, by default the true one."""
        camera = camera or self.cameras[name]
        return Anchor(
            name, camera, self.scan.gbuffer(camera.scaled(0.25), ("depth",)).depth, expected
        )

    def errors_px(self, found):
        """(photos,) median distance of the mesh's images by true and by placed cameras."""
        pairs = zip(self.block.cameras, self.cameras.values(), strict=True)
        placed = [(found.world_from_block.camera(mine), true) for mine, true in pairs]
        return np.array([np.median(offsets_px(a, b, self.mesh.vertices[::7])) for a, b in placed])


def reconstruction(cameras, xyz, block_from_world, rng) -> Reconstruction:
    """A block as structure from motion gives it: noise of .3 px in pictures, and in the points."""
    sightings = []
    for k, camera in enumerate(cameras.values()):
        xy, _ = camera.project(xyz)
        seen = np.flatnonzero(camera.inside(xy))
        noisy = xy[seen] + rng.normal(scale=0.3, size=(len(seen), 2))
        sightings += [(p, k, *pixel) for p, pixel in zip(seen, noisy, strict=True)]
    table = np.array(sorted(sightings))
    count = np.bincount(table[:, 0].astype(int), minlength=len(xyz))
    return Reconstruction(
        names=tuple(cameras),
        cameras=tuple(block_from_world.camera(camera) for camera in cameras.values()),
        lenses=("lens",) * len(cameras),
        points=block_from_world.apply(xyz + rng.normal(scale=0.001, size=xyz.shape)),
        error_px=np.full(len(xyz), 0.3),
        angle_rad=np.full(len(xyz), 0.3),
        track_starts=np.concatenate([[0], np.cumsum(count)]),
        observer=table[:, 1].astype(np.intp),
        xy_px=table[:, 2:].astype(np.float32),
    )


@pytest.fixture(scope="module")
def scene():
    """Five photos of a relief with a fifth of their points on a bush in front of it."""
    rng = np.random.default_rng(4)
    cameras = {
        f"{k}.jpg": Camera(LENS, Pose.look_at(place, (0.1 * k - 0.2, 0, 1.2)))
        for k, place in enumerate(PLACES)
    }
    x, z = rng.uniform((-1.4, 0.1), (1.4, 2.3), (600, 2)).T
    surface = np.stack([x, -height(x, z), z], 1)
    bush = rng.uniform((-0.5, -1.2, 0.9), (0.3, -0.6, 1.6), (150, 3))
    turn = Pose.look_at((0, 0, 0), (1, 2, 3)).R
    world_from_block = Similarity(3.7, turn, np.array([5.0, -2.0, 0.3]))
    xyz = np.concatenate([surface, bush])
    block = reconstruction(cameras, xyz, world_from_block.inverse, rng)
    mesh = relief()
    with open_renderer(RenderOptions(renderer="cpu")) as renderer, renderer.load(mesh) as scan:
        yield Scene(mesh, scan, cameras, block, world_from_block)


def moved(camera, degrees, shift):
    """A camera that is registered wrongly: it looks elsewhere and stands elsewhere."""
    return replace(camera, pose=camera.pose.step([*np.radians(degrees), *shift]))


def test_one_photo_puts_the_block_on_the_mesh(scene):
    """One photo registered truly: all photos within a pixel, though a fifth of the points are not
    on the mesh; the scale is true to its own deviation.
    """
    found = anchored(scene.block, [scene.anchor("2.jpg")])
    off = np.log(found.world_from_block.scale / scene.world_from_block.scale)

    assert scene.errors_px(found).max() < 1
    assert 0.6 < found.agreeing[0] < 0.95
    assert found.contradicts == ()
    assert abs(off) < 4 * found.sigma[6]
    assert 0.0001 < found.sigma[6] < 0.003


def test_a_wrong_focal_length_does_not_matter(scene):
    """A photo registered with a focal length 4 % too long from 4 % farther away shows the same
    mesh at the same pixels, nearly; the block is where it was.
    """
    true = scene.cameras["2.jpg"]
    lens = replace(LENS, fx=1.04 * LENS.fx, fy=1.04 * LENS.fy)
    back = true.pose.apply([[0, 0, 1.2]])[0, 2] * 0.04
    wrong = Camera(lens, true.pose.step([0, 0, 0, 0, 0, back]))
    by_camera = np.median(offsets_px(wrong, true, scene.mesh.vertices[::7]))
    found = anchored(scene.block, [scene.anchor("2.jpg", wrong, expected=by_camera)])

    assert by_camera > 0.5
    assert scene.errors_px(found).max() < 3 * by_camera
    assert abs(np.log(found.world_from_block.scale / scene.world_from_block.scale)) < 0.01


def test_the_expected_error_is_true(scene):
    """Photos registered a few pixels off, in many ways: what is expected of the others is their
    error, within a factor of 1.5 in the median.
    """
    rng = np.random.default_rng(0)
    ratio = []
    for name in scene.block.names * 4:
        turn, shift = rng.normal(scale=0.06, size=3), rng.normal(scale=0.004, size=3)
        wrong = moved(scene.cameras[name], turn, shift)
        gap = offsets_px(wrong, scene.cameras[name], scene.mesh.vertices[::7])
        expected = float(np.sqrt(np.mean(gap**2)))
        found = anchored(scene.block, [scene.anchor(name, wrong, expected)])
        ratio += list(scene.errors_px(found) / found.expected_error_px)

    assert 1 / 1.5 < np.median(ratio) < 1.5
    assert np.percentile(ratio, 98) < 4


def test_several_photos_are_better_than_one(scene):
    """Errors of the registrations average out, and the deviations say so."""
    rng = np.random.default_rng(1)
    wrong = {
        name: moved(camera, rng.normal(scale=0.08, size=3), rng.normal(scale=0.004, size=3))
        for name, camera in scene.cameras.items()
    }
    each = [anchored(scene.block, [scene.anchor(n, c, 3.0)]) for n, c in wrong.items()]
    together = anchored(scene.block, [scene.anchor(n, c, 3.0) for n, c in wrong.items()])

    single = [scene.errors_px(found).max() for found in each]
    assert scene.errors_px(together).max() < np.median(single)
    assert (together.sigma < np.min([found.sigma for found in each], axis=0)).all()


def test_a_photo_that_contradicts_the_others_is_named(scene):
    """One of three registrations is grossly wrong: the block stays where the others put it."""
    anchors = [scene.anchor("0.jpg"), scene.anchor("3.jpg")]
    anchors.append(scene.anchor("4.jpg", moved(scene.cameras["4.jpg"], (3, -5, 4), (0.1, 0, 0.3))))
    found = anchored(scene.block, anchors)

    assert found.contradicts == ("4.jpg",)
    assert scene.errors_px(found).max() < 1.5
    with pytest.raises(RegistrationError, match=r"0\.jpg, 4\.jpg contradict each other"):
        anchored(scene.block, [anchors[0], anchors[2]])


def test_what_shows_too_little_of_the_mesh_is_refused(scene):
    """A photo that looks past the mesh, and a mesh of another shape, each with what to do."""
    past = moved(scene.cameras["2.jpg"], (0, 70, 0), (0, 0, 0))
    with pytest.raises(RegistrationError, match=r"lie on the mesh where 2\.jpg shows it"):
        anchored(scene.block, [scene.anchor("2.jpg", past)])
    rng = np.random.default_rng(0)
    other = replace(scene.block, points=rng.normal(size=scene.block.points.shape))
    with pytest.raises(RegistrationError, match="differ in shape"):
        anchored(other, [scene.anchor("2.jpg")])
