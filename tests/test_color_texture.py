"""Coloring a texture, on planes whose colors are known on paper."""

from contextlib import closing

import numpy as np
import pytest
from color_scenes import camera, joined, moved, pattern, picture, plane
from photo_sets import photo_set

from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import fill_unseen
from texproj.color.points.texels import TexelPoints
from texproj.color.texture import color_texture
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import linear_from_srgb
from texproj.render import open_renderer
from texproj.resources.scratch import Scratch
from texproj.unwrap.texel_faces import face_image
from texproj.unwrap.unwrap import unwrap

VIEWS = ((0.3, 0.2, 3.0), (-0.9, 0.4, 2.8), (0.8, -0.7, 2.6), (-0.2, -0.9, 3.1))


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


@pytest.fixture(scope="module")
def textured(renderer):
    mesh, cameras = (
        joined(plane(), moved(plane(6, half=0.2), (0, 0, -5))),
        [camera(c) for c in VIEWS],
    )
    photos = [picture(c) for c in cameras]
    return mesh, color_texture(mesh, photo_set(cameras, photos), renderer)


def texels(mesh, atlas):
    """Every texel on the surface: its page position and its place in the world."""
    scratch = Scratch()
    points = TexelPoints.of(mesh, atlas, scratch)
    for number, tile in enumerate(points.tiles):
        row, column = np.nonzero(points.mask(number))
        chunk = points.chunk(number)
        xyz = chunk.xyz + points.owners.origin
        yield tile.page, row + tile.rows.start, column + tile.columns.start, xyz, chunk.owner
    scratch.close()


def test_texels_lie_the_same_where_faces_are_too_many_to_keep_all_maps(textured, monkeypatch):
    mesh, texture = textured
    usual = list(texels(mesh, texture.atlas))
    monkeypatch.setattr("texproj.color.points.texels.MOST_FRAMES", 0)
    for one, other in zip(usual, texels(mesh, texture.atlas), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_texels_have_the_colors_of_the_surface(textured):
    """Where several photos see a texel, it has the pattern's color within 8-bit rounding."""
    mesh, texture = textured
    checked = 0
    for page, row, column, xyz, _ in texels(mesh, texture.atlas):
        sure = (texture.photo_count[page][row, column] > 1) & (xyz[:, 2] > -1)
        value = linear_from_srgb(texture.pages[page][row, column][sure] / 255)
        wanted = pattern(xyz[sure, 0], xyz[sure, 1])
        assert np.abs(value - wanted).max() < 0.012
        checked += int(sure.sum())
    assert checked > 10_000


def test_every_texel_lies_on_its_face(textured):
    """The corners' texels map back to the corners' positions."""
    mesh, texture = textured
    atlas = texture.atlas
    for page, row, column, xyz, owner in texels(mesh, atlas):
        assert (atlas.page_of_face[owner] == page).all()
        corners = mesh.vertices[mesh.faces[owner]]
        low, high = corners.min(axis=1) - 1e-3, corners.max(axis=1) + 1e-3
        assert ((xyz >= low) & (xyz <= high)).all()
        assert len(row) == len(column) == len(xyz)


def test_unseen_surface_is_reported_and_never_black(textured):
    """The plane behind is counted as unseen, and no texel of any page is black."""
    mesh, texture = textured
    assert texture.quality["seen"] < 1
    hidden = [
        texture.photo_count[page][row, column][xyz[:, 2] < -1]
        for page, row, column, xyz, _ in texels(mesh, texture.atlas)
    ]
    assert not np.concatenate(hidden).any()
    assert min(page.min() for page in texture.pages) > 60


def test_gutters_continue_the_charts(textured):
    """Two texels outside of the charts the color is that of the chart's border."""
    _, texture = textured
    for number, page in enumerate(texture.pages):
        faces = face_image(texture.atlas, number)
        inside = faces >= 0
        shifted = np.zeros_like(inside)
        shifted[:, 2:] = inside[:, :-2]
        gutter = shifted & ~inside
        row, column = np.nonzero(gutter)
        step = np.abs(page[row, column].astype(int) - page[row, column - 2].astype(int))
        assert np.median(step) <= 4


def test_sixteen_bits(renderer):
    """With bits = 16 the pages are finer than 8 bits can tell."""
    mesh, view = plane(4), camera(VIEWS[0])
    photo = picture(view)
    texture = color_texture(mesh, photo_set([view], [photo]), renderer, ColorOptions(bits=16))
    assert texture.pages[0].dtype == np.uint16
    assert len(np.unique(texture.pages[0][..., 0])) > 256


def test_each_texel_center_has_one_face():
    """Faces that share edges cover every texel center once: the counts add up to the area."""
    mesh = plane(7)
    atlas = unwrap(mesh, 40.0)
    covered = sum(int((face_image(atlas, i) >= 0).sum()) for i in range(len(atlas.page_sizes)))
    area = 4 * 40.0**2 * atlas.stats.scale**2
    assert covered == pytest.approx(area, rel=0.02)


def test_fill_keeps_what_is_known():
    """Push-pull leaves known texels alone and puts only mixtures of known colors elsewhere."""
    rng = np.random.default_rng(3)
    page = rng.integers(100, 200, (331, 217, 3)).astype(np.uint8)
    known = rng.random(page.shape[:2]) < 0.01
    before = page.copy()
    page[~known] = 0
    fill_page(page, known)
    assert np.array_equal(page[known], before[known])
    low, high = before[known].min(axis=0), before[known].max(axis=0)
    assert (page >= low).all() and (page <= high).all()


def test_what_is_filled_has_no_seam(textured):
    """A disc that nobody sees, amid a pattern: colors go on over its border without a step, without
    anything darker or brighter than what is around it; what is further away stays to the bit.
    """
    mesh, texture = textured
    pages, counts = [p.copy() for p in texture.pages], [c.copy() for c in texture.photo_count]
    with closing(Scratch()) as scratch:
        points = TexelPoints.of(mesh, texture.atlas, scratch)
        apart = np.full(counts[0].shape, np.inf)
        for number, tile in enumerate(points.tiles):
            xyz = points.chunk(number).xyz + points.owners.origin
            away = np.where(xyz[:, 2] > -1, np.hypot(xyz[:, 0], xyz[:, 1]), np.inf)
            assert tile.page == 0
            points.place(number, apart, away)
        hidden = apart < 0.3
        pages[0][hidden], counts[0][hidden] = 0, 0
        fill_unseen(mesh, texture.atlas, points, pages, counts)

    seen = pages[0][(apart > 0.3) & np.isfinite(apart)]
    assert hidden.sum() > 1500
    assert (pages[0][hidden] >= seen.min(axis=0)).all()
    assert (pages[0][hidden] <= seen.max(axis=0)).all()
    steps = np.abs(np.diff(pages[0].astype(int), axis=1)).max(axis=-1)
    border = hidden[:, 1:] != hidden[:, :-1]
    beside = (apart[:, 1:] < 0.6) & (apart[:, :-1] < 0.6) & ~hidden[:, 1:] & ~hidden[:, :-1]
    assert steps[border].mean() < 1.5 * steps[beside].mean() + 1
    far = np.isfinite(apart) & (apart > 0.6)
    np.testing.assert_array_equal(pages[0][far], texture.pages[0][far])
