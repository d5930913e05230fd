"""The measure of seams, and the seams of patches by it, on planes whose colors are known."""

from contextlib import closing

import numpy as np
import pytest
from color_scenes import camera, pattern, picture, plane
from photo_sets import photo_set
from seams import seams_of

from texproj.color.patches.charts import continued
from texproj.color.patches.texture import PatchSettings, color_patches
from texproj.color.points.texels import TexelPoints
from texproj.mesh import TexturedMesh
from texproj.options import PatchOptions, RenderOptions
from texproj.photo import Photo, linear_from_srgb, srgb_from_linear
from texproj.render import open_renderer
from texproj.resources.scratch import Scratch
from texproj.unwrap.regions import dual_graph
from texproj.unwrap.texel_faces import face_image

VIEWS = ((0.3, 0.2, 3.0), (-0.9, 0.4, 2.8), (0.8, -0.7, 2.6), (-0.2, -0.9, 3.1), (0.1, 0.9, 3.2))
SIDE = 64


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


def halves(step: float) -> TexturedMesh:
    """A plane textured from two pages, one for each side of x = 0: ramps of a value per texel along
    x, the right one higher by `step` than the left one goes on.
    """
    mesh = plane(8)
    right = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0
    uv = (mesh.vertices[:, :2] + 1) / 2
    ramp = np.broadcast_to(80 + np.arange(SIDE)[None, :, None], (SIDE, SIDE, 3))
    pages = tuple((ramp + extra).astype(np.uint8) for extra in (0, step))
    return TexturedMesh(mesh.vertices, mesh.faces, uv, mesh.faces, right.astype(np.int32), pages)


@pytest.mark.parametrize("step", [0, 10])
def test_a_step_is_measured_as_high_as_it_is(step):
    """Across the border the ramp's own rise of 2.5 texels and the step, nothing else."""
    found = seams_of(halves(step))
    assert found.borders == pytest.approx(2.5 + step, abs=0.1)
    assert 1.0 < found.inside < 2.5


def test_a_step_that_the_photos_show_is_no_seam(renderer):
    """The same step, as paint on the surface: the ratio stays, the excess is gone; photos without
    it make it an excess.
    """
    model, view = halves(10), camera((0.0, 0.0, 3.0))

    def paint(step):
        def colors(x, y):
            value = 80 + (x + 1) / 2 * SIDE + step * (x > 0) + 0 * y
            return np.repeat(linear_from_srgb(value / 255)[..., None], 3, axis=-1)

        return np.round(255 * srgb_from_linear(picture(view, colors).pixels)).astype(np.uint8)

    true = seams_of(model, [(view, paint(10))], renderer)
    false = seams_of(model, [(view, paint(0))], renderer)
    assert true.ratio == false.ratio > 4
    assert true.shared == pytest.approx(1)
    assert true.excess == pytest.approx(1, abs=0.15)
    assert false.excess > 4


def photographed(cameras: list) -> list[Photo]:
    """A gentle pattern, the photos 1 EV brighter or darker and darkened to one side."""
    ramp = np.linspace(-0.25, 0.25, 240, dtype=np.float32)[None, :, None]
    gains, sides = (0.5, 1.0, 1.4, 0.7, 1.0), (1, -1, 1, -1, 0)
    return [
        picture(c, lambda x, y: 0.4 + 0.1 * pattern(x, y), gain=g * (1 + side * ramp))
        for c, g, side in zip(cameras, gains, sides, strict=True)
    ]


def measured(renderer, **options):
    """The seams of patches as small as can be, so that there are many."""
    mesh, cameras = plane(40), [camera(c) for c in VIEWS]
    photos = photographed(cameras)
    small = PatchOptions(seam_px=0.0, resolution=2.0, smallest_px=0.0, **options)
    texture = color_patches(mesh, photo_set(cameras, photos), renderer, PatchSettings(patch=small))
    atlas = texture.atlas
    size = np.array(atlas.page_sizes, float)
    page = np.zeros(len(atlas.uv_px), int)
    page[atlas.faces.ravel()] = np.repeat(atlas.page_of_face, 3)
    uv = atlas.uv_px / size[page] * [1, -1] + [0, 1]
    model = TexturedMesh(
        mesh.vertices, mesh.faces, uv, atlas.faces, atlas.page_of_face, texture.pages
    )
    return seams_of(model)


def test_seams_between_photos_of_different_exposure_are_as_smooth_as_the_surface(renderer):
    """Steps at borders between 0.8 and 1.1 times those inside; without fading and leveling the
    same photos leave more than 1.3 times.
    """
    assert 0.8 < measured(renderer).ratio <= 1.1
    assert measured(renderer, strip_px=0.01, level_px=0.0).ratio > 1.3


def test_texels_beside_a_patch_go_on_as_the_surface_does(renderer):
    """Two texels around a patch on a plane have the colors of the plane there, as exactly as those
    of the patch: there is nothing made up that a filter could mix in.
    """
    mesh, cameras = plane(40), [camera(c) for c in VIEWS]
    photos = [picture(c) for c in cameras]
    settings = PatchSettings(patch=PatchOptions(seam_px=0.0, resolution=2.0, smallest_px=0.0))
    texture = color_patches(mesh, photo_set(cameras, photos), renderer, settings)
    growing = continued(mesh, texture.atlas, dual_graph(mesh))
    with closing(Scratch()) as scratch:
        points = TexelPoints.of(mesh, texture.atlas, scratch, growing)
        beside, errors = 0, []
        for number, tile in enumerate(points.tiles):
            mask = points.mask(number)
            xyz = points.chunk(number).xyz + points.owners.origin
            page = texture.pages[tile.page][tile.rows, tile.columns][mask]
            inside = face_image(texture.atlas, tile.page)[tile.rows, tile.columns][mask] >= 0
            near = ~inside & (np.abs(xyz[:, :2]).max(axis=1) < 1)
            truth = pattern(xyz[near, 0], xyz[near, 1])
            errors.append(np.abs(linear_from_srgb(page[near] / 255) - truth).max(axis=1))
            beside += near.sum()
    assert beside > 1000
    assert np.concatenate(errors).max() < 0.012
