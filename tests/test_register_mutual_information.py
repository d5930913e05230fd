"""Registration by mutual information on a uniform matte piece whose camera is known."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import PAIR, matte_pair, scan_of, scene_of, taken

from texproj.demo.photographer import ShotOptions
from texproj.demo.sensor import Sensor
from texproj.demo.views import disturbed
from texproj.errors import RegistrationError
from texproj.mesh import vertex_normals
from texproj.options import MutualInformationOptions
from texproj.photo import Correspondences
from texproj.register.information.comparison import Comparison, PhotoLevel
from texproj.register.information.register import register_mutual_information
from texproj.register.information.samples import map_images, outline_samples, surface_samples
from texproj.render import ambient_occlusion, open_renderer


@pytest.fixture(scope="module")
def shot():
    """A capital, its photo and true camera, and a rendering function."""
    scene = matte_pair(1, "capital")
    loaded = open_renderer().load(scene.mesh, ambient_occlusion(scene.mesh, rays=32))
    return scene, lambda camera: loaded.gbuffer(camera, ("depth", "normal", "ao", "front"))


def seen_points(scene):
    toward = scene.cameras[0].center - scene.mesh.vertices
    facing = (toward * vertex_normals(scene.mesh)).sum(1) > 0
    return scene.mesh.vertices[facing][::7]


def percent_off(scene, camera):
    points, truth = seen_points(scene), scene.cameras[0]
    gap = camera.project(points)[0] - truth.project(points)[0]
    return 100 * np.linalg.norm(gap, axis=1).mean() / truth.width


def moved(scene, error_px, seed):
    return disturbed(
        scene.cameras[0], seen_points(scene), error_px, np.random.default_rng([seed, 9])
    )


@pytest.mark.parametrize("seed", [1, 2])
def test_uniform_matte_object_comes_within_a_third_of_a_percent(shot, seed):
    """From 15 px of 480 (3 %): within 0.3 % of the width, accepted, and the claim is honest."""
    scene, render = shot
    start = moved(scene, 15, seed)
    fit = register_mutual_information(scene.photos[0], start, render)
    error = percent_off(scene, fit.camera)
    assert percent_off(scene, start) == pytest.approx(3.1, abs=0.2)
    assert error < 0.3
    assert fit.accepted, fit.reason
    assert error / 5 < 100 * fit.expected_error_px / fit.camera.width < 0.5
    assert fit.quality["information_bits"] > 1.2 * fit.quality["information_before_bits"]
    assert fit.covariance.shape == (6, 6)


def test_another_picture_is_refused(shot):
    """The photo turned upside down holds no such object where the start says."""
    scene, render = shot
    turned = replace(scene.photos[0], pixels=np.ascontiguousarray(scene.photos[0].pixels[::-1]))
    fit = register_mutual_information(turned, moved(scene, 10, 3), render)
    assert not fit.accepted
    assert fit.reason


def test_the_mirror_image_of_a_nearly_symmetric_object_is_refused():
    """A slab with carvings, seen from the side; from the same start the true photo is found."""
    shots = [ShotOptions(background="gradient", sensor=Sensor(full_well=4000))] * 2
    piece = scene_of("stele", 0, matte=True)
    scene = taken(piece, scan_of("stele", 0), PAIR[:2], shots, 768)
    loaded = open_renderer().load(scene.mesh, ambient_occlusion(scene.mesh))
    photo, truth = scene.photos[1], scene.cameras[1]
    toward = truth.center - scene.mesh.vertices
    points = scene.mesh.vertices[(toward * vertex_normals(scene.mesh)).sum(1) > 0][::7]
    start = disturbed(truth, points, 20, np.random.default_rng([1, 1, 9]))
    mirrored = replace(photo, pixels=np.ascontiguousarray(photo.pixels[:, ::-1]))

    def render(camera):
        return loaded.gbuffer(camera, ("depth", "normal", "ao", "front"))

    assert register_mutual_information(photo, start, render).accepted
    assert not register_mutual_information(mirrored, start, render).accepted


def test_nothing_in_view_is_an_error(shot):
    """A start that looks away names the photo and what to do."""
    scene, render = shot
    camera = scene.cameras[0]
    away = replace(camera, pose=camera.pose.step([0, np.pi, 0, 0, 0, 0]))
    with pytest.raises(RegistrationError, match=r"0001\.jpg.*closer start"):
        register_mutual_information(scene.photos[0], away, render)


def test_picks_decide_where_shading_says_little(shot):
    """Exact picks bring the picked points closer than shading alone leaves them."""
    scene, render = shot
    xyz = seen_points(scene)[::60]
    picks = Correspondences(scene.cameras[0].project(xyz)[0], xyz)
    fit = register_mutual_information(
        scene.photos[0], moved(scene, 10, 4), render,
        MutualInformationOptions(pick_sigma_percent=0.02), picks,
    )  # fmt: skip
    assert percent_off(scene, fit.camera) < 0.08
    assert len(fit.residual_px) == len(picks)
    assert np.median(fit.residual_px) < 0.4


@pytest.mark.parametrize(
    "options",
    [
        MutualInformationOptions(maps=("normal-x", "normal-y", "ao")),
        MutualInformationOptions(maps=("combined", "silhouette")),
        MutualInformationOptions(maps=("normal", "silhouette"), gradients=True),
        MutualInformationOptions(measure="normalized"),
    ],
    ids=["surface only", "combined", "gradients", "normalized"],
)
def test_every_measure_is_higher_at_the_truth(shot, options):
    """Each choice of maps and measure prefers the true camera to eight that are 2 % off."""
    scene, render = shot
    level = PhotoLevel.of(scene.photos[0], scene.cameras[0], 256, options.gradients)
    here = Comparison.at(level, render, options, exact=False)
    truth = here.information(here.camera)
    for seed in range(8):
        pose = moved(scene, 10, 100 + seed).pose
        assert here.information(replace(here.camera, pose=pose)) < truth


def test_leaving_the_picture_does_not_pay(shot):
    """Turned away until nothing of the mesh is in the picture, the measure is 0."""
    scene, render = shot
    options = MutualInformationOptions()
    level = PhotoLevel.of(scene.photos[0], scene.cameras[0], 256, gradients=False)
    here = Comparison.at(level, render, options, exact=False)
    away = replace(here.camera, pose=here.camera.pose.step([0, 1.2, 0, 0, 0, 0]))
    assert here.information(away) == 0


def test_maps_are_what_they_say(shot):
    """Normals and reflections fill 0..1; the blend is occlusion where dark, normal where open."""
    scene, render = shot
    camera = replace(
        scene.cameras[0].scaled(0.25), intrinsics=scene.cameras[0].scaled(0.25).intrinsics.pinhole
    )
    images = render(camera)
    solid = np.isfinite(images.depth) & images.front
    blend = map_images(images, camera, ("combined",))
    plain = map_images(images, camera, ("normal", "ao"))
    open_, dark = solid & (images.ao > 0.98), solid & (images.ao < 0.1)
    assert len(blend) == 3 and len(plain) == 4
    assert np.abs(blend[0] - plain[0])[open_].max() < 0.05
    assert np.abs(blend[0] - images.ao)[dark].max() < 0.02
    reflection = np.stack(map_images(images, camera, ("reflection",)), axis=2)[solid] * 2 - 1
    assert np.linalg.norm(reflection, axis=1) == pytest.approx(1, abs=0.02)


def test_samples_lie_on_what_is_rendered(shot):
    """Surface samples project onto their pixels; outline samples stand on both sides of it."""
    scene, render = shot
    k = scene.cameras[0].scaled(0.5).intrinsics.pinhole
    camera = replace(scene.cameras[0], intrinsics=k)
    images = render(camera)
    samples = surface_samples(images, camera, ("ao",), 3000)
    xy = camera.project(samples.xyz_in_world)[0]
    assert 2000 < len(samples) < 4000
    assert np.abs(xy % 1 - 0.5).max() < 1e-3
    outline = outline_samples(images, camera, 3000, distances=False)
    inside = outline.values[0] > 0.5
    column, row = camera.project(outline.xyz_in_world)[0].astype(int).T
    solid = np.isfinite(images.depth) & images.front
    assert (solid[row, column] == inside).all()
    assert 0.2 < inside.mean() < 0.8
