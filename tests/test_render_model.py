"""Pictures of colored models: every color known on paper, by both renderers."""

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.mesh import ColoredMesh, TexturedMesh
from texproj.options import RenderOptions
from texproj.render import open_renderer, render_model

CAMERA = Camera(Intrinsics(64, 48, 64, 64, 32, 24), Pose.identity())
CORNERS = np.array([(-1, -0.5, 2), (1, -0.5, 2), (1, 0.5, 2), (-1, 0.5, 2)], float)
"""Seen by CAMERA as columns 0 .. 63, rows 8 .. 39."""
FACES = np.array([[0, 2, 1], [0, 3, 2]], np.int32)
UV = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], float)
"""The top left corner of the quad is the top left corner of the page: v points up."""


@pytest.fixture(scope="module", params=["gl", "cpu"])
def renderer(request):
    with open_renderer(RenderOptions(renderer=request.param)) as renderer:
        yield renderer


def textured(*pages, page_of_face=(0, 0), scale=1.0) -> TexturedMesh:
    return TexturedMesh(
        CORNERS * scale, FACES, UV, FACES, np.array(page_of_face, np.int32), tuple(pages)
    )


def test_the_page_stands_upright(renderer):
    """One texel per pixel, seen straight: the picture is the page."""
    page = np.random.default_rng(0).integers(0, 256, (32, 64, 3), dtype=np.uint8)
    picture = render_model(renderer, textured(page), CAMERA, samples=1)
    assert np.abs(picture[8:40, :, :3].astype(int) - page).max() <= 1
    assert (picture[8:40, :, 3] == 255).all()
    assert (picture[:8] == 0).all()
    assert (picture[40:] == 0).all()


def test_sixteen_bit_and_alpha_pages(renderer):
    """A 16-bit page shows like its 8-bit twin; a fourth channel is ignored."""
    page = np.random.default_rng(0).integers(0, 256, (32, 64, 4), dtype=np.uint8)
    pictures = [
        render_model(renderer, textured(p), CAMERA, 1) for p in (page, page * np.uint16(257))
    ]
    assert np.abs(pictures[0].astype(int) - pictures[1]).max() <= 1
    assert (pictures[0][20, :, 3] == 255).all()


def test_each_face_has_its_page(renderer):
    """Two pages and a face without texture."""
    red, blue = (np.full((8, 8, 3), c, np.uint8) for c in ((200, 0, 0), (0, 0, 200)))
    picture = render_model(renderer, textured(red, blue, page_of_face=(1, 0)), CAMERA, 1)
    assert tuple(picture[12, 50]) == (0, 0, 200, 255)
    assert tuple(picture[35, 10]) == (200, 0, 0, 255)
    bare = render_model(renderer, textured(red, page_of_face=(-1, 0)), CAMERA, 1)
    assert tuple(bare[12, 50]) == (124, 124, 124, 255)


@pytest.mark.parametrize("turn_deg", [0, 70])
def test_far_textures_are_averaged_in_linear_light(renderer, turn_deg):
    """A checker of black and white texels, 16 or more per pixel, is linear 0.5: sRGB 188."""
    checker = np.indices((512, 1024)).sum(axis=0) % 2 * np.uint8(255)
    page = np.repeat(checker[..., None], 3, axis=2).astype(np.uint8)
    angle = np.radians(turn_deg)
    center = np.array([2 * np.sin(angle), 0, 2 - 2 * np.cos(angle)])
    camera = Camera(CAMERA.intrinsics, Pose.look_at(center, (0, 0, 2), (0, -1, 0)))
    picture = render_model(renderer, textured(page), camera, samples=1)
    inside = picture[..., 3] == 255
    assert inside.sum() > 300
    assert np.abs(picture[inside][:, :3].astype(int) - 188).max() <= 1


def test_vertex_colors_are_interpolated_in_linear_light(renderer):
    """Black to white across: at part p linear light is p."""
    colors = np.array([[0] * 3, [255] * 3, [255] * 3, [0] * 3], np.uint8)
    picture = render_model(renderer, ColoredMesh(CORNERS, FACES, colors), CAMERA, samples=1)
    light = (np.arange(64) + 0.5) / 64
    expected = 255 * (1.055 * light ** (1 / 2.4) - 0.055)
    assert np.abs(picture[20, :, 0] - expected).max() <= 1


def test_alpha_is_coverage(renderer):
    """An edge that halves a pixel column gives alpha 1/2 and leaves the color alone."""
    half = ColoredMesh(
        np.array([(-1, -0.5, 2), (0.015625, -0.5, 2), (0.015625, 0.5, 2), (-1, 0.5, 2)]),
        FACES,
        np.full((4, 3), 120, np.uint8),
    )
    picture = render_model(renderer, half, CAMERA, samples=4)
    assert abs(int(picture[20, 32, 3]) - 128) <= 1
    assert tuple(picture[20, 32, :3]) == (120, 120, 120)


def test_with_a_lens_the_picture_bends_with_the_photo(renderer):
    """A white texel on black appears where the full lens model projects it."""
    page = np.zeros((200, 400, 3), np.uint8)
    page[20:24, 340:344] = 255
    lens = Intrinsics(64, 48, 40, 40, 32, 24, (-0.3, 0.1, 0.0, 0.0, 0.0))
    camera = Camera(lens, Pose.identity())
    picture = render_model(renderer, textured(page), camera, samples=4)[..., 0].astype(float)
    light = np.where(picture > 0, picture, 0) ** 2.2
    y, x = np.indices(picture.shape) + 0.5
    found = np.array([(light * x).sum(), (light * y).sum()]) / light.sum()
    point = np.array([[-1 + 2 * 342 / 400, -0.5 + 22 / 200, 2]])
    assert np.linalg.norm(found - camera.project(point)[0]) < 0.1
