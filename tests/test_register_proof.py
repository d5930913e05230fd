"""Cameras that others found, before the picture: right ones pass, wrong ones do not."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from texproj.camera import Camera
from texproj.formats.cameras import read_cameras
from texproj.formats.interchange import upright
from texproj.formats.meshes import read_mesh
from texproj.formats.photos import read_photo, read_photo_info
from texproj.options import RenderOptions
from texproj.project import Project
from texproj.register.proof.prove import prove
from texproj.register.proof.texture import textured
from texproj.render import open_renderer
from texproj.repair import repair

CHANNELS = ("depth", "normal", "front")


def opened(folder, truth):
    """A project's mesh, photos and true cameras, ready to be proved."""
    project = Project.open(folder)
    records = read_cameras(truth).records
    renderer = open_renderer(RenderOptions())
    scene = renderer.load(project.load_mesh().mesh)
    return SimpleNamespace(
        names=[record.file for record in records],
        cameras=[record.camera for record in records],
        load=lambda k, longest: project.load_photo(records[k].file, longest),
        render=lambda camera: scene.gbuffer(camera, CHANNELS),
    )


@pytest.fixture(scope="module")
def demo(demo_folder):
    return opened(demo_folder, demo_folder / "truth" / "cameras.json")


def standings(scene, cameras, judged=None):
    found = prove(cameras, scene.load, scene.render, judged)
    return {k: proof.standing for k, proof in found.items()}


def test_true_cameras_are_proved(demo):
    """On a mesh of few faces, from lines of sight forty degrees apart."""
    assert set(standings(demo, demo.cameras).values()) == {"proved"}


def test_half_a_pixel_is_no_contradiction(demo):
    """Conventions of pixel centers differ by so much; nothing on a picture tells."""
    moved = [shifted(camera, 0.5) for camera in demo.cameras]

    assert "contradicted" not in standings(demo, moved).values()


def shifted(camera, px):
    k = camera.intrinsics
    return Camera(replace(k, cx=k.cx + px, cy=k.cy + px), camera.pose)


def disturbed(camera, px, seed):
    """Turned and moved by about `px` pixels at the object."""
    step = np.random.default_rng(seed).normal(0, px / camera.intrinsics.fx / 1.4, 6)
    step[3:] *= np.linalg.norm(camera.center)
    return Camera(camera.intrinsics, camera.pose.step(step))


WRONG = {
    "four percent off": lambda c, k: disturbed(c, 0.04 * c.width, k),
    "one percent off": lambda c, k: disturbed(c, 0.012 * c.width, k),
    "upside down": lambda c, k: upright(c, 3),
    "another focal length": lambda c, k: Camera(
        replace(c.intrinsics, fx=0.9 * c.intrinsics.fx, fy=0.9 * c.intrinsics.fy), c.pose),
}  # fmt: skip


@pytest.mark.parametrize("fault", WRONG)
def test_a_file_of_wrong_cameras_proves_nothing(demo, fault):
    """No camera of it is vouched for."""
    wrong = [WRONG[fault](camera, k) for k, camera in enumerate(demo.cameras)]

    assert set(standings(demo, wrong).values()) == {"contradicted"}


def test_one_wrong_camera_is_the_only_one(demo):
    """The others confirm each other, and none of them is held to account for it."""
    alone = standings(demo, demo.cameras)
    wrong = [upright(c, 3) if k == 1 else c for k, c in enumerate(demo.cameras)]
    found = standings(demo, wrong)

    assert found[1] == "contradicted"
    assert all(found[k] != "contradicted" for k in found if k != 1)
    assert alone[1] == "proved"


def test_a_wrong_lens_is_not_exact(demo):
    """A focal length off by two percent leaves photos that agree; their lens is not vouched for."""
    zoomed = [
        Camera(replace(c.intrinsics, fx=0.98 * c.intrinsics.fx, fy=0.98 * c.intrinsics.fy), c.pose)
        for c in demo.cameras
    ]
    found = prove(zoomed, demo.load, demo.render)

    assert not any(proof.exact for proof in found.values())


def test_known_cameras_speak_for_new_ones(demo):
    """A file of one photo is proved by a photo that is registered, and judged alone."""
    found = standings(demo, demo.cameras, judged=[1])
    wrong = [upright(c, 3) if k == 1 else c for k, c in enumerate(demo.cameras)]

    assert found == {1: "proved"}
    assert standings(demo, wrong, judged=[1]) == {1: "contradicted"}


def test_photos_without_anything_on_them_prove_nothing(demo):
    """Gray photos with a camera's noise: neither proved nor contradicted."""

    def plain(k, longest):
        photo = demo.load(k, longest)
        noise = np.random.default_rng(k).normal(128, 2, photo.pixels.shape)
        return replace(photo, pixels=noise.clip(0, 255).astype(np.uint8))

    found = prove(demo.cameras, plain, demo.render)

    assert {proof.standing for proof in found.values()} == {"unproved"}
    assert all("unproved" in proof.reason for proof in found.values())


def test_texture_is_told_from_noise():
    """Noise of two gray levels is none; the edge of a soft shadow is."""
    noise = np.random.default_rng(0).normal(0.5, 2 / 255, (100, 100)).astype(np.float32)
    shadow = cv2.GaussianBlur(np.where(np.arange(100) < 50, 0.3, 0.5), (0, 0), 3)
    edge = np.tile(shadow.astype(np.float32).reshape(1, -1), (100, 1))

    assert textured(noise).mean() < 0.02
    assert textured(edge)[:, 45:55].all() and not textured(edge)[:, :30].any()


def test_real_cameras_are_proved_and_their_starts_are_not(real_data):
    """Three photos beside each other: true cameras pass exactly, those 120 px off do not."""
    folder = real_data("sceaux-castle")
    true, off = (
        read_cameras(folder / f"cameras_{name}.json").records[3:6]
        for name in ("reference", "start_120px")
    )
    scan = repair(*read_mesh(folder / "mesh.ply")).mesh
    with open_renderer(RenderOptions()) as renderer, renderer.load(scan) as images:

        def load(k, longest):
            path = folder / "photos" / true[k].file
            return read_photo(path, read_photo_info(path), None, longest)

        def render(camera):
            return images.gbuffer(camera, CHANNELS)

        found = prove([r.camera for r in true], load, render)
        wrong = prove([r.camera for r in off], load, render)

    assert all(proof.standing == "proved" and proof.exact for proof in found.values())
    assert {proof.standing for proof in wrong.values()} == {"contradicted"}
