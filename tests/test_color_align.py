"""Displacements of photos on the surface, on a plane whose pattern is known on paper."""

from dataclasses import replace

import numpy as np
import pytest
from color_scenes import camera, picture, plane
from photo_sets import photo_set

from texproj.camera import Camera, Intrinsics
from texproj.color.alignment.flow import sure_flow
from texproj.color.sampling.prepare import photo_view
from texproj.color.sampling.view import LENS_CELL
from texproj.color.texture import color_texture
from texproj.color.vertices import color_vertices
from texproj.options import ColorOptions, RenderOptions
from texproj.render import open_renderer

VIEWS = ((0.1, 0.2, 3.0), (-0.7, 0.3, 2.8), (0.6, -0.5, 2.7), (-0.2, -0.7, 3.0))
WRONG = (2.0, -1.5)
"""Pixels by which the second photo is off, and the third the other way."""


def busy(x, y):
    """Linear colors with detail of every size from a tenth of the plane on."""
    waves = sum(
        np.sin(f * (np.cos(a) * x + np.sin(a) * y) + 7 * a) / 3
        for f, a in ((6, 0.3), (11, 1.4), (17, 2.3), (23, 0.8), (31, 1.9), (37, 2.9))
    )
    return np.stack([0.35 + 0.1 * waves, 0.4 + 0.12 * waves, 0.3 + 0.08 * waves], axis=-1)


def noise(shape=(240, 320), seed=0):
    """Smooth noise that can be evaluated at any place."""
    rng = np.random.default_rng(seed)
    f = rng.normal(0, 0.35, (60, 2))
    phase = rng.uniform(0, 6.28, 60)

    def at(x, y):
        return 0.5 + 0.02 * sum(
            np.sin(a * x + b * y + p) for (a, b), p in zip(f, phase, strict=True)
        )

    x, y = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
    return at, x.astype(np.float32), y.astype(np.float32)


@pytest.fixture(scope="module")
def cpu():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


def test_a_smooth_displacement_is_found():
    """A displacement that grows over the picture is found to a tenth of a pixel, to its sign."""
    at, x, y = noise()
    dx, dy = 1.5 + x / 320, -1.0 + 0 * y
    there = at(x, y).astype(np.float32)
    here = at(x - dx, y - dy).astype(np.float32)
    shift, sure = sure_flow(here, there, np.ones(x.shape, bool), 10.0)
    inner = np.s_[30:-30, 30:-30]
    assert sure[inner].mean() > 0.8
    # here is seen at q + d(q + d) = q + d (1 + 1/320).
    assert np.abs(shift[inner] - np.dstack([dx, dy])[inner]).max() < 0.15
    assert np.abs(shift[inner] - np.dstack([dx, dy])[inner]).max() > 1e-4


def test_what_is_not_sure_is_not_moved():
    """Flat parts, unlike parts, empty parts and long ways give no displacement."""
    at, x, y = noise()
    there = at(x, y).astype(np.float32)
    everywhere = np.ones(x.shape, bool)
    other = noise(seed=5)[0](x, y).astype(np.float32)
    for here, base, solid, largest in (
        (np.full_like(there, 0.5), np.full_like(there, 0.5), everywhere, 10.0),
        (other, there, everywhere, 10.0),
        (at(x - 3, y).astype(np.float32), there, ~everywhere, 10.0),
        (at(x - 3, y).astype(np.float32), there, everywhere, 2.0),
    ):
        shift, sure = sure_flow(here, base, solid, largest)
        assert sure.mean() < 0.05  # by chance
        assert np.abs(shift).mean() < 0.1


def test_displacements_move_the_lookup(cpu):
    """A view's shift is added to that of the lens, where the photo has it."""
    with cpu.load(plane()) as scene:
        view = camera(VIEWS[0], dist=(0.05, 0, 0, 0, 0))
        plain = photo_view(picture(view), view, scene, ColorOptions())
    shift = np.zeros((18, 24, 2), np.float32)
    shift[:, 12:] = WRONG
    table = np.moveaxis(replace(plain, shift=shift).lens - plain.lens, 0, -1)
    assert table[3, 2] == pytest.approx((0, 0), abs=1e-5)
    assert table[3, -3] == pytest.approx(WRONG, abs=1e-5)
    assert LENS_CELL == 8


def wrong_photos():
    """Photos of the busy plane, and cameras of which two are off by `WRONG`, to either side."""
    cameras = [camera(c) for c in VIEWS]
    photos = [picture(c, busy) for c in cameras]
    for number, sign in ((1, 1), (2, -1)):
        k = cameras[number].intrinsics
        cx, cy = k.cx - sign * WRONG[0], k.cy - sign * WRONG[1]
        off = Intrinsics(k.width, k.height, k.fx, k.fy, cx, cy, k.dist)
        cameras[number] = Camera(off, cameras[number].pose)
    return cameras, photos


@pytest.fixture(scope="module")
def colored(cpu):
    """Vertex colors of the plane without and with alignment."""
    cameras, photos = wrong_photos()
    mesh = plane(60)
    return mesh, [
        color_vertices(mesh, photo_set(cameras, photos), cpu, ColorOptions(align=on, gains=False))
        for on in (False, True)
    ]


def test_photos_that_are_off_are_put_right(colored):
    """Most of the error that photos make which are off by 2.5 pixels goes."""
    mesh, results = colored
    inner = np.abs(mesh.vertices[:, :2]).max(axis=1) < 0.6
    truth = busy(mesh.vertices[:, 0], mesh.vertices[:, 1])
    before, after = (np.sqrt(np.square(r.rgb - truth)[inner].mean()) for r in results)
    assert before > 0.004
    assert after < 0.6 * before


def test_the_report_says_how_far_it_was_off(colored):
    """The photo's displacement is reported to half a pixel, the others' is small."""
    entries = colored[1][1].quality["alignment"]
    assert [e["file"] for e in entries] == ["0", "1", "2", "3"]
    expected = float(np.hypot(*WRONG))
    assert all(0.7 * expected < entries[i]["median_px"] < 1.2 * expected for i in (1, 2))
    assert all(entries[i]["median_px"] < 0.3 * expected for i in (0, 3))
    assert all(0.3 < e["sure"] <= 1 for e in entries)
    assert "alignment" not in colored[1][0].quality


def test_textures_are_aligned_alike(cpu):
    """A texture reports the same displacement as vertex colors do."""
    cameras, photos = wrong_photos()
    result = color_texture(
        plane(8), photo_set(cameras, photos), cpu, ColorOptions(align=True, gains=False)
    )
    assert 1.7 < result.quality["alignment"][1]["median_px"] < 3
