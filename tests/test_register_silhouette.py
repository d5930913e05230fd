"""Outlines: distances on paper, segmentation, and a camera found without any start."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import matte_pair, synthetic_pair

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import RegistrationError
from texproj.mesh import vertex_normals
from texproj.options import SilhouetteOptions
from texproj.register.outline import chain
from texproj.register.outline.chain import register_from_outline
from texproj.register.outline.object_mask import object_mask
from texproj.register.outline.register import guessed_lens, hypotheses
from texproj.render import ambient_occlusion, open_renderer
from texproj.solve.silhouette import (
    OutlineDistance,
    Signature,
    best_turns,
    outline,
    signed_distance,
    sphere_directions,
    splatted,
    xor_share,
)


def box_mask(rows, columns, shape=(60, 80)):
    mask = np.zeros(shape, bool)
    mask[slice(*rows), slice(*columns)] = True
    return mask


def test_distance_runs_from_the_border_between_pixels():
    """Beside a straight edge: -1.5, -0.5 | +0.5, +1.5; the picture's border is no edge."""
    distance = signed_distance(box_mask((0, 60), (0, 40)))
    assert distance[30, 37:43] == pytest.approx([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5])
    assert distance[0, 0] == pytest.approx(-39.5, abs=0.6)


def test_outline_is_the_outermost_row_of_pixels():
    """A 10 x 20 box has 56 of them; cut by the picture's border it has fewer."""
    assert len(outline(box_mask((10, 20), (30, 50)))[0]) == 56
    assert len(outline(box_mask((0, 20), (30, 50)))[0]) == 20 + 2 * 19


def test_xor_of_boxes():
    """Two 10 x 10 boxes half over each other: 100 of 150 pixels differ."""
    a, b = box_mask((10, 20), (10, 20)), box_mask((10, 20), (15, 25))
    assert xor_share(a, b) == pytest.approx(100 / 150)
    assert xor_share(a, a) == 0
    assert xor_share(a & ~a, a & ~a) == 1


def test_directions_are_spread_evenly():
    """No point of the sphere is further than 8 degrees from one of 500; they are unit vectors."""
    directions = sphere_directions(500)
    asked = np.random.default_rng(0).standard_normal((1000, 3))
    asked /= np.linalg.norm(asked, axis=1, keepdims=True)
    assert np.degrees(np.arccos((asked @ directions.T).max(axis=1))).max() < 8
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1)


@pytest.mark.parametrize("degrees", [0, 40, 165, -90])
def test_a_signature_finds_the_turn(degrees):
    """An L-shaped mask, turned clockwise, moved and enlarged, is recognized with its turn."""
    rng = np.random.default_rng(1)
    ell = np.concatenate([rng.uniform((-9, -9), (-3, 12), (40_000, 2)),
                          rng.uniform((-9, -9), (10, -4), (40_000, 2))])  # fmt: skip
    a = np.radians(degrees)
    R = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    plain = Signature.of(splatted(3 * ell + 90, 180, 180))
    turned = Signature.of(splatted(4.2 * ell @ R.T + (120, 110), 250, 220))
    other = Signature.of(box_mask((20, 40), (20, 40)))
    overlap, view, roll = best_turns(turned, np.stack([other.polar, plain.polar]), 1)[0]
    assert view == 1 and overlap > 0.85
    assert abs((np.degrees(roll) - degrees + 180) % 360 - 180) < 6
    assert turned.radius_px / plain.radius_px == pytest.approx(1.4, abs=0.06)


def test_the_slope_of_the_outline_distance_is_right():
    """Analytic against central differences."""
    camera = Camera(Intrinsics(80, 60, 90, 90, 40, 30), Pose.look_at((0, -4, 0.5), (0, 0, 0)))
    points = np.random.default_rng(3).uniform(-0.8, 0.8, (50, 3))
    y, x = np.mgrid[:60, :80]
    smooth = (np.hypot(x - 41, y - 28) - 17).astype(np.float32)
    problem = OutlineDistance(points, smooth, sigma_px=2.0, expected_px=-0.5, free=("focal",))
    analytic = problem.jacobian(camera)[:, 0]
    inside = np.isfinite(problem.residual(camera)[:, 0])
    for k, axis in enumerate(np.eye(7)):
        ahead, behind = (problem.residual(problem.step(camera, s * axis)) for s in (5e-3, -5e-3))
        numeric = (ahead - behind)[:, 0] / 1e-2
        assert (
            np.nanmedian(np.abs(numeric - analytic[:, k])[inside])
            < 0.1 + 0.05 * np.abs(analytic[inside, k]).max()
        )


@pytest.fixture(scope="module")
def shot():
    """A uniform capital before a plain background, and a rendering function."""
    scene = matte_pair(1, "capital")
    loaded = open_renderer().load(scene.mesh, ambient_occlusion(scene.mesh, rays=32))
    return scene, lambda camera: loaded.gbuffer(camera, ("depth", "normal", "ao", "front"))


def percent_off(scene, camera):
    truth = scene.cameras[0]
    facing = ((truth.center - scene.mesh.vertices) * vertex_normals(scene.mesh)).sum(1) > 0
    points = scene.mesh.vertices[facing][::7]
    gap = camera.project(points)[0] - truth.project(points)[0]
    return 100 * np.linalg.norm(gap, axis=1).mean() / truth.width


def test_an_object_before_a_plain_background_is_cut_out(shot):
    """Automatic mask and true mask differ by less than 5 % of the object."""
    scene, _ = shot
    assert xor_share(object_mask(scene.photos[0]), scene.masks[0] > 0) < 0.05


def test_a_garden_is_no_plain_background():
    """It is refused; with a rough projection of the object, GrabCut comes close."""
    scene = synthetic_pair(1)
    with pytest.raises(RegistrationError, match="give a mask"):
        object_mask(scene.photos[0])
    true = scene.masks[0] > 0
    rough = np.roll(true, (6, -8), axis=(0, 1))
    found = object_mask(scene.photos[0], rough)
    assert xor_share(found, true) < 0.5 * xor_share(rough, true)


def test_the_photos_own_mask_goes_first(shot):
    scene, _ = shot
    mask = np.zeros_like(scene.masks[0])
    mask[50:100, 60:90] = 255
    assert object_mask(replace(scene.photos[0], mask=mask)).sum() == 50 * 30


def test_no_start_at_all(shot, monkeypatch):
    """From the lens and the mask alone to within 2 % of the width, and then to within 0.3 %."""
    scene, render = shot
    lens, mask = scene.cameras[0].intrinsics, scene.masks[0] > 0
    found = []

    def watched(*given):
        found.extend(hypotheses(*given))
        return found

    monkeypatch.setattr(chain, "hypotheses", watched)
    exact = register_from_outline(scene.photos[0], lens, render, scene.mesh, mask=mask)
    best, second, *_ = found
    assert percent_off(scene, best.camera) < 2
    assert second.xor < 1.5 * best.xor  # its other sides look alike
    assert percent_off(scene, exact.camera) < 0.3
    assert exact.accepted, exact.reason


def test_from_a_rough_camera(shot):
    """A start 4 % off is pulled to within 1 % by the outline alone; no search, so no others."""
    scene, render = shot
    start = replace(scene.cameras[0], pose=scene.cameras[0].pose.step([0.01, 0.02, 0.03, 0, 0, 0]))
    mask = scene.masks[0] > 0
    (found,) = hypotheses(scene.photos[0], start, render, scene.mesh, SilhouetteOptions(), mask)
    assert percent_off(scene, start) > 2
    assert percent_off(scene, found.camera) < 1


def test_the_outline_of_something_else_is_refused(shot):
    """A disk is no view of a capital."""
    scene, render = shot
    y, x = np.mgrid[: scene.photos[0].height, : scene.photos[0].width]
    disk = np.hypot(x - 240, y - 160) < 90
    lens = scene.cameras[0].intrinsics
    fit = register_from_outline(scene.photos[0], lens, render, scene.mesh, mask=disk)
    assert not fit.accepted


def test_a_lens_is_guessed_from_the_header(shot):
    """EXIF's focal length if there is one, else 1.1 times the longer side; centered."""
    info = shot[0].photos[0].info
    assert guessed_lens(info).fx == info.focal_px
    assert guessed_lens(replace(info, focal_px=None)).fx == pytest.approx(1.1 * info.width)
    assert guessed_lens(info).cx == info.width / 2
