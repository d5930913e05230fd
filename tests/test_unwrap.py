"""Charts: every face has a place of its own, of the right size, on pages that suffice."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from texproj.errors import InputError
from texproj.mesh import Mesh, face_areas
from texproj.options import UnwrapOptions
from texproj.unwrap import parts
from texproj.unwrap.unwrap import unwrap

OPTIONS = UnwrapOptions()


def owners(atlas, page):
    """((h, w) int chart of each texel center or -1, (h, w) int number of faces over it).

    Tries every texel center in the bounding box of every face; centers on an edge count for
    neither side.
    """
    width, height = atlas.page_sizes[page]
    chart, count = np.full((height, width), -1), np.zeros((height, width), int)
    for face in np.flatnonzero(atlas.page_of_face == page):
        corners = atlas.uv_px[atlas.faces[face]]
        low, high = np.floor(corners.min(0)).astype(int), np.ceil(corners.max(0)).astype(int)
        x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
        sides = [
            (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
            for a, b in pairwise([*corners, corners[0]])
        ]
        inside = (np.min(sides, axis=0) > 1e-9) | (np.max(sides, axis=0) < -1e-9)
        rows, columns = np.nonzero(inside)
        chart[rows + low[1], columns + low[0]] = atlas.chart_of_face[face]
        count[rows + low[1], columns + low[0]] += 1
    return chart, count


def flat_areas(corners):
    p, q = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]) / 2


def check(mesh, atlas, density):
    """What must hold for every atlas; a chart per connected patch, no texel with two owners."""
    assert atlas.faces.shape == mesh.faces.shape
    assert (atlas.vertex_of_uv[atlas.faces] == mesh.faces).all()
    assert np.isfinite(atlas.uv_px).all()
    assert len(np.unique(atlas.chart_of_face)) == atlas.stats.charts
    sizes = np.array(atlas.page_sizes)[atlas.page_of_face][:, None]
    corners = atlas.uv_px[atlas.faces]
    border = atlas.padding_px / 2
    assert (corners >= border).all()
    assert (corners <= sizes - border).all()
    for page in range(len(atlas.page_sizes)):
        chart, count = owners(atlas, page)
        assert count.max() == 1
        reach = 2 * (atlas.padding_px // 2) + 1
        highest = ndimage.maximum_filter(chart, reach)
        lowest = ndimage.minimum_filter(np.where(chart < 0, 10**9, chart), reach)
        assert ((highest == lowest) | (highest < 0)).all(), "two charts closer than the padding"
    texels = flat_areas(corners)
    wanted = face_areas(mesh).sum() * (density * atlas.stats.scale) ** 2
    return texels.sum() / wanted


def grid(columns, rows):
    """Vertices (n, 2) and faces of a sheet of unit squares, each cut in two."""
    index = np.arange((columns + 1) * (rows + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    y, x = np.divmod(np.arange(index.size), columns + 1)
    return np.stack([x, y], axis=1).astype(float), faces


def sheet(columns, rows, height=0.0):
    flat, faces = grid(columns, rows)
    return Mesh(np.column_stack([flat, np.broadcast_to(height, len(flat))]), faces)


def moebius(segments=60):
    """A band with half a turn."""
    flat, faces = grid(segments, 4)
    t, s = 2 * np.pi * flat[:, 0] / segments, (flat[:, 1] - 2) / 8
    r = 1 + s * np.cos(t / 2)
    vertices = np.stack([r * np.cos(t), r * np.sin(t), s * np.sin(t / 2)], axis=1)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.merge_vertices()
    return Mesh(mesh.vertices, mesh.faces)


def ramp(turns=3, per_turn=48, rise=0.2):
    """A spiral ramp: nearly level everywhere, and above itself after each turn."""
    flat, faces = grid(turns * per_turn, 5)
    t, r = 2 * np.pi * flat[:, 0] / per_turn, 1 + 0.2 * flat[:, 1]
    return Mesh(np.stack([r * np.cos(t), r * np.sin(t), rise * t / 2 / np.pi], axis=1), faces)


def test_cube_becomes_six_squares():
    """A cube is six charts without stretch, of the size asked for."""
    box = trimesh.creation.box((1, 1, 1))
    mesh = Mesh(box.vertices, box.faces)
    atlas = unwrap(mesh, 40.0, OPTIONS)
    assert atlas.stats.charts == 6
    assert atlas.stats.stretch_p95 == pytest.approx(1, abs=1e-3)
    assert 0.999 <= check(mesh, atlas, 40) <= 1.05


def test_one_triangle():
    """A mesh of one triangle is one chart."""
    mesh = Mesh([[0, 0, 0], [3, 0, 0], [0, 0, 4]], [[0, 1, 2]])
    atlas = unwrap(mesh, 20.0, OPTIONS)
    assert atlas.stats.charts == 1
    assert 0.999 <= check(mesh, atlas, 20) <= 1.1


def test_a_speck_still_gets_a_texel():
    """A triangle far smaller than a texel covers a texel center all the same."""
    mesh = Mesh([[0, 0, 0], [1e-3, 0, 0], [0, 1e-3, 0]], [[0, 1, 2]])
    atlas = unwrap(mesh, 1.0, OPTIONS)
    assert (owners(atlas, 0)[1] == 1).any()


def test_plane_is_one_chart():
    """A flat sheet is one chart that fills nearly all of its page."""
    mesh = sheet(30, 20)
    atlas = unwrap(mesh, 8.0, OPTIONS)
    assert atlas.stats.charts == 1
    assert atlas.stats.packed_fraction > 0.85
    assert 0.999 <= check(mesh, atlas, 8) <= 1.05


def test_sphere():
    """A sphere is a few charts; a mean stretch far below that of a hemisphere."""
    ball = trimesh.creation.icosphere(4)
    mesh = Mesh(ball.vertices, ball.faces)
    atlas = unwrap(mesh, 60.0, OPTIONS)
    assert 6 <= atlas.stats.charts <= 40
    assert 1 < atlas.stats.stretch_median < 1.15
    assert atlas.stats.stretch_p95 < 1.5
    assert 0.999 <= check(mesh, atlas, 60) <= 1.1


@pytest.mark.parametrize("density", [60.0, 25.0])
def test_a_large_surface_is_unwrapped_part_by_part(monkeypatch, density):
    """A sphere in parts of a fifth: hardly more charts than whole; at 25 texels a unit its faces
    are smaller than the cells in which charts are packed.
    """
    ball = trimesh.creation.icosphere(4)
    mesh = Mesh(ball.vertices, ball.faces)
    whole = unwrap(mesh, density, OPTIONS)
    monkeypatch.setattr(parts, "MOST_FACES", 1000)
    atlas = unwrap(mesh, density, OPTIONS)
    assert atlas.stats.charts <= 1.5 * whole.stats.charts
    assert atlas.stats.stretch_p95 < 1.5
    assert atlas.stats.packed_fraction > 0.75 * whole.stats.packed_fraction
    assert 0.999 <= check(mesh, atlas, density) <= 1.15


def test_disconnected_pieces_share_no_chart():
    """Two coplanar sheets apart from each other are two charts."""
    one, faces = grid(5, 5)
    both = np.concatenate([one, one + np.array([7, 0])])
    mesh = Mesh(np.column_stack([both, np.zeros(len(both))]), np.concatenate([faces, faces + 36]))
    atlas = unwrap(mesh, 10.0, OPTIONS)
    assert atlas.stats.charts == 2
    assert 0.999 <= check(mesh, atlas, 10) <= 1.1


def test_moebius_strip():
    """A surface with one side is unwrapped like any other."""
    mesh = moebius()
    atlas = unwrap(mesh, 50.0, OPTIONS)
    assert 2 <= atlas.stats.charts <= 40
    assert 0.999 <= check(mesh, atlas, 50) <= 1.25


def test_three_sheets_in_one_edge():
    """An edge of three faces ends the charts, and every face has its place."""
    mesh = Mesh(
        [[0, 0, 0], [0, 0, 1], [1, 0, 0.5], [-1, 0.1, 0.5], [-1, -0.1, 0.5]],
        [[0, 1, 2], [0, 1, 3], [0, 1, 4]],
    )
    atlas = unwrap(mesh, 50.0, OPTIONS)
    assert atlas.stats.charts == 3
    assert 0.999 <= check(mesh, atlas, 50) <= 1.1


def test_winding_that_disagrees():
    """Two neighbors of opposite winding have their places too."""
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 2, 3]])
    assert 0.999 <= check(mesh, unwrap(mesh, 30.0, OPTIONS), 30) <= 1.1


def test_a_spiral_does_not_cover_itself():
    """A ramp that turns three times above itself without any steep face is cut."""
    mesh = ramp()
    atlas = unwrap(mesh, 40.0, OPTIONS)
    assert atlas.stats.overlap_splits > 0
    assert 3 <= atlas.stats.charts <= 40
    assert 0.999 <= check(mesh, atlas, 40) <= 1.1


def test_noise_does_not_shatter():
    """A wall whose faces tilt by 25 degrees from noise alone stays nearly whole."""
    noise = np.random.default_rng(7).normal(0, 0.3, 61 * 41)
    mesh = sheet(60, 40, noise)
    tilt = np.degrees(np.arccos(np.abs(face_normal_z(mesh))))
    assert np.median(tilt) > 20
    atlas = unwrap(mesh, 6.0, OPTIONS)
    assert atlas.stats.charts <= 3
    assert 0.95 <= check(mesh, atlas, 6) <= 1.05


def face_normal_z(mesh):
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return normals[:, 2] / np.linalg.norm(normals, axis=1)


def test_density_per_face():
    """Faces that ask for twice the texels per unit get four times the area."""
    one, faces = grid(10, 10)
    both = np.concatenate([one, one + np.array([20, 0])])
    mesh = Mesh(np.column_stack([both, np.zeros(len(both))]), np.concatenate([faces, faces + 121]))
    density = np.repeat([4.0, 8.0], len(faces))
    atlas = unwrap(mesh, density, OPTIONS)
    corners = atlas.uv_px[atlas.faces]
    area = flat_areas(corners)
    first, second = area[: len(faces)].sum(), area[len(faces) :].sum()
    assert first == pytest.approx(100 * 16, rel=0.1)
    assert second == pytest.approx(100 * 64, rel=0.05)


def test_several_pages():
    """What does not fit one page goes on others; nothing shrinks while there are pages left."""
    box = trimesh.creation.box((1, 1, 1))
    mesh = Mesh(box.vertices, box.faces)
    atlas = unwrap(mesh, 100.0, replace(OPTIONS, page_size=128, max_pages=8))
    assert len(atlas.page_sizes) == 6
    assert atlas.stats.scale == 1
    assert 0.999 <= check(mesh, atlas, 100) <= 1.05


def test_a_chart_longer_than_a_page_is_cut():
    """A strip of 900 x 120 texels goes on pages of 256 at full resolution, in parts."""
    mesh = sheet(150, 20)
    atlas = unwrap(mesh, 6.0, replace(OPTIONS, page_size=256, max_pages=8))
    assert atlas.stats.scale == 1
    assert 4 <= atlas.stats.charts <= 5
    assert np.max(atlas.page_sizes) <= 256
    assert 0.999 <= check(mesh, atlas, 6) <= 1.05


def test_too_few_pages_lower_the_resolution():
    """On one page of 128 texels a cube asking for 6 x 100 x 100 shrinks, by a scale that is
    reported, and not more than needed.
    """
    box = trimesh.creation.box((1, 1, 1))
    mesh = Mesh(box.vertices, box.faces)
    atlas = unwrap(mesh, 100.0, replace(OPTIONS, page_size=128, max_pages=1))
    assert atlas.page_sizes[0][0] <= 128
    assert atlas.page_sizes[0][1] <= 128
    assert len(atlas.page_sizes) == 1
    assert 0.25 < atlas.stats.scale < 0.5
    assert 0.999 <= check(mesh, atlas, 100) <= 1.2


@pytest.mark.parametrize("padding", [1, 2, 3, 8])
def test_padding(padding):
    """The gutter is as wide as asked for, for any width."""
    ball = trimesh.creation.icosphere(3)
    mesh = Mesh(ball.vertices, ball.faces)
    atlas = unwrap(mesh, 30.0, replace(OPTIONS, padding_px=padding))
    assert atlas.padding_px == padding
    assert 0.999 <= check(mesh, atlas, 30) <= 1.25


def test_the_same_again():
    """Two runs give the same atlas to the last bit."""
    ball = trimesh.creation.icosphere(4)
    mesh = Mesh(ball.vertices, ball.faces)
    one, two = unwrap(mesh, 50.0, OPTIONS), unwrap(mesh, 50.0, OPTIONS)
    assert (one.uv_px == two.uv_px).all()
    assert (one.faces == two.faces).all()


def test_far_from_the_origin():
    """At map coordinates of millions of units the atlas is as good as at the origin."""
    ball = trimesh.creation.icosphere(3)
    mesh = Mesh(ball.vertices + np.array([4e5, 5e6, 100]), ball.faces)
    atlas = unwrap(mesh, 30.0, OPTIONS)
    assert atlas.stats.charts <= 40
    assert 1 < atlas.stats.stretch_median < 1.15
    assert 0.999 <= check(mesh, atlas, 30) <= 1.25


@pytest.mark.parametrize("faces", [np.zeros((0, 3)), [[0, 1, 2]]])
def test_no_surface(faces):
    """A mesh without faces, or with flat lines only, is refused with a sentence."""
    with pytest.raises(InputError, match="no faces"):
        unwrap(Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces), 1.0, OPTIONS)
