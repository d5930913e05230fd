"""Patches cut from single photos, on planes whose colors are known on paper."""

from itertools import product

import numpy as np
import pytest
from color_scenes import camera, joined, moved, pattern, picture, plane
from photo_sets import photo_set

from texproj.color.patches.charts import patch_atlas
from texproj.color.patches.labels import _Problem, choose_photos, merge_islands
from texproj.color.patches.texture import PatchSettings, color_patches
from texproj.color.patches.views import FaceViews
from texproj.color.points.texels import TexelPoints
from texproj.mesh import Mesh
from texproj.options import PatchOptions, RenderOptions, UnwrapOptions
from texproj.photo import linear_from_srgb, srgb_from_linear
from texproj.render import open_renderer
from texproj.unwrap.regions import dual_graph
from texproj.unwrap.texel_faces import face_image

VIEWS = ((0.3, 0.2, 3.0), (-0.9, 0.4, 2.8), (0.8, -0.7, 2.6), (-0.2, -0.9, 3.1), (0.1, 0.9, 3.2))


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


def patched(mesh, photos, cameras, renderer, **options):
    settings = PatchSettings(patch=PatchOptions(**options))
    return color_patches(mesh, photo_set(cameras, photos), renderer, settings)


def texels(mesh, texture):
    """Color (linear), photo count, place in the world and face of every texel on the surface."""
    from contextlib import closing

    from texproj.resources.scratch import Scratch

    with closing(Scratch()) as scratch:
        points = TexelPoints.of(mesh, texture.atlas, scratch)
        parts = []
        for number, tile in enumerate(points.tiles):
            mask, chunk = points.mask(number), points.chunk(number)
            page = texture.pages[tile.page][tile.rows, tile.columns][mask]
            count = texture.photo_count[tile.page][tile.rows, tile.columns][mask]
            xyz = chunk.xyz + points.owners.origin
            parts.append((linear_from_srgb(page / 255), count, xyz, chunk.owner.copy()))
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def error(mesh, texture):
    """Difference to the pattern at the seen texels of the plane z = 0."""
    rgb, count, xyz, _ = texels(mesh, texture)
    sure = (count > 0) & (xyz[:, 2] > -1)
    assert sure.sum() > 10_000
    return np.abs(rgb[sure] - pattern(xyz[sure, 0], xyz[sure, 1])).max(axis=1)


def test_texels_have_the_colors_of_the_surface(renderer):
    """Every seen texel has the pattern's color within 8-bit rounding, whatever its patch."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]
    texture = patched(mesh, [picture(c) for c in cameras], cameras, renderer)
    assert error(mesh, texture).max() < 0.012


def test_a_patch_is_cut_from_its_photo_pixel_by_pixel(renderer):
    """With one photo, each patch is the photo moved by whole pixels, turned at most by 90 degrees,
    and has its 8-bit values.
    """
    mesh, view = plane(), camera(VIEWS[0], dist=(-0.08, 0.02, 0.001, 0, 0))
    photo = picture(view)
    texture = patched(mesh, [photo], [view], renderer)
    atlas = texture.atlas
    uv = atlas.uv_px[atlas.faces]
    xy = view.project(mesh.vertices[mesh.faces].reshape(-1, 3))[0].reshape(uv.shape)
    straight, turned = uv - xy, uv - xy[..., ::-1]
    offset = straight if np.ptp(straight[..., 0]) < np.ptp(turned[..., 0]) else turned
    assert atlas.stats.charts == 1
    assert np.abs(offset - np.round(offset.mean(axis=(0, 1)))).max() < 1e-6
    page = texture.pages[0] if offset is straight else texture.pages[0].swapaxes(0, 1)
    dx, dy = np.round(offset.mean(axis=(0, 1))).astype(int)[:: 1 if offset is straight else -1]
    inside = face_image(atlas, 0) >= 0
    row, column = np.nonzero(inside if offset is straight else inside.T)
    wanted = np.round(srgb_from_linear(photo.pixels[row - dy, column - dx]) * 255)
    assert np.abs(page[row, column] - wanted).max() <= 1


def test_an_occluder_in_the_closest_photo_is_not_used(renderer):
    """A dark thing in front of the surface in one photo of five leaves no trace, though that photo
    has the most pixels on the surface.
    """
    cameras = [camera((0.1, 0.1, 1.6)), *(camera(c) for c in VIEWS[1:])]
    photos = [picture(c) for c in cameras]
    photos[0].pixels[60:120, 80:150] = (0.02, 0.1, 0.02)
    mesh = plane()
    assert error(mesh, patched(mesh, photos, cameras, renderer)).max() < 0.04


def seam_ratio(mesh, texture, labels):
    """Mean color step across the edges between faces of different charts against that across
    edges inside of charts, each between points a third into the two faces.
    """
    atlas, graph = texture.atlas, dual_graph(mesh)
    centers = atlas.uv_px[atlas.faces].mean(axis=1)
    column, row = np.floor(centers).astype(int).T
    color = np.stack([texture.pages[p][r, c] for p, r, c in zip(atlas.page_of_face, row, column,
                                                                strict=True)])  # fmt: skip
    step = np.abs(np.diff(color[graph.pairs].astype(float), axis=1)).mean(axis=(1, 2))
    across = ~graph.within(labels.astype(np.int64))
    assert across.sum() > 20
    return step[across].mean() / step[~across].mean()


def test_seams_between_differently_exposed_photos_do_not_show(renderer):
    """Photos of +-1 EV that darken to one side: steps at seams are at most 1.1 times those inside,
    and they would be more without the strip and the leveling.
    """
    mesh, cameras = plane(40), [camera(c) for c in VIEWS]
    ramp = np.linspace(-0.25, 0.25, 240, dtype=np.float32)[None, :, None]
    gains, sides = (0.5, 1.0, 1.4, 0.7, 1.0), (1, -1, 1, -1, 0)
    photos = [
        picture(c, lambda x, y: 0.4 + 0.1 * pattern(x, y), gain=g * (1 + side * ramp))
        for c, g, side in zip(cameras, gains, sides, strict=True)
    ]
    divided = {"seam_px": 0.0, "resolution": 2.0, "smallest_px": 0.0}
    texture = patched(mesh, photos, cameras, renderer, **divided)
    plain = patched(mesh, photos, cameras, renderer, **divided, strip_px=0.01, level_px=0.0)
    labels = plain.atlas.chart_of_face
    assert seam_ratio(mesh, texture, labels) <= 1.1
    assert seam_ratio(mesh, plain, labels) > 1.3


def test_no_texel_has_two_faces():
    """A bump that hides what is behind it: a patch that would cover itself is cut, so that the
    faces' areas on the pages add up to the texels covered.
    """
    flat = plane(60)
    x, y, _ = flat.vertices.T
    mesh = Mesh(np.stack([x, y, 0.7 * np.exp(-12 * (x**2 + y**2))], axis=1), flat.faces)
    view = camera((2.4, 0.3, 1.2))
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    front = ((view.center - corners[:, 0]) * normals).sum(axis=1) > 0
    labels = np.where(front, 0, -1).astype(np.int32)
    density = np.full(len(labels), 60.0, np.float32)
    atlas = patch_atlas(mesh, dual_graph(mesh), [view], labels, density, UnwrapOptions())
    assert atlas.stats.overlap_splits > 0
    corners = atlas.uv_px[atlas.faces]
    (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    covered = sum((face_image(atlas, i) >= 0).sum() for i in range(len(atlas.page_sizes)))
    assert covered == pytest.approx(0.5 * np.abs(a * d - b * c).sum(), rel=0.02)


def test_unseen_surface_is_reported_and_never_black(renderer):
    """A plane hidden behind counts as unseen and takes a color of the seen surface."""
    mesh = joined(plane(), moved(plane(6, half=0.2), (0, 0, -5)))
    cameras = [camera(c) for c in VIEWS]
    texture = patched(mesh, [picture(c) for c in cameras], cameras, renderer)
    _, count, xyz, _ = texels(mesh, texture)
    assert not count[xyz[:, 2] < -1].any()
    assert texture.quality["seen"] == pytest.approx(4 / 4.16, abs=0.02)
    assert min(page.min() for page in texture.pages) > 60


def test_faces_too_large_for_any_photo_are_put_together(renderer):
    """A square of two faces, each photo shows parts of them: together they color nearly all."""
    mesh = plane(1)
    cameras = [camera((x, y, 1.0), (x, y, 0)) for x in (-0.5, 0.5) for y in (-0.6, 0.0, 0.6)]
    texture = patched(mesh, [picture(c) for c in cameras], cameras, renderer)
    count = texels(mesh, texture)[1]
    assert (count > 0).mean() > 0.95
    assert error(mesh, texture).max() < 0.02


def test_a_photo_that_cannot_be_read_is_left_out(renderer):
    """The others color the surface; the lost one is named, and has no entry among the others."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]
    photos = [None, *(picture(c) for c in cameras[1:])]
    texture = patched(mesh, photos, cameras, renderer)
    assert texture.failed == {"0": "photo 0 is damaged"}
    assert [row["file"] for row in texture.quality["photos"]] == [
        str(number) for number in range(1, len(VIEWS))
    ]
    assert error(mesh, texture).max() < 0.012


def test_pages_that_are_too_small_shrink_all_patches_alike(renderer):
    """The scale is reported, and every page keeps to the limit."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]
    photos = [picture(c) for c in cameras]
    settings = PatchSettings(unwrap=UnwrapOptions(page_size=96, max_pages=1))
    texture = color_patches(mesh, photo_set(cameras, photos), renderer, settings)
    assert 0.2 < texture.quality["scale"] < 0.9
    assert [max(page.shape[:2]) <= 96 for page in texture.pages] == [True]


def strip(costs):
    """A row of faces with (F, p) costs, neighbors in a chain."""
    n, p = costs.shape
    order = np.argsort(costs, axis=1)
    return FaceViews(
        order.astype(np.int32),
        np.take_along_axis(costs, order, axis=1).astype(np.float32),
        np.zeros((n, p, 3), np.float32),
        np.ones(n, np.float32),
        np.full((n, p), -1, np.int32),
        np.full((n, p), -1, np.int32),
    )


@pytest.mark.parametrize("seed", range(20))
def test_expansion_of_two_photos_is_optimal(seed):
    """Of all 4096 labelings of 12 faces with two photos, the cheapest is found."""
    rng = np.random.default_rng(seed)
    costs = rng.random((12, 2))
    pairs = np.array(
        [(i, j) for i, j in product(range(12), repeat=2) if i < j and rng.random() < 0.3]
    )
    seam = rng.random(len(pairs))
    problem = _Problem.of(strip(costs), np.full(12, 1000.0, np.float32), pairs, 1000 * seam)
    start = np.zeros(12, np.int32)
    found = problem.expanded(start, np.ones(12, bool))

    def energy(labels):
        cut = labels[pairs[:, 0]] != labels[pairs[:, 1]]
        return costs[np.arange(12), labels].sum() + seam[cut].sum()

    best = min(energy(np.array(labels)) for labels in product((0, 1), repeat=12))
    assert energy(found) == pytest.approx(best, abs=1e-3)


def test_only_photos_that_show_a_face_are_chosen():
    """Random candidates on a plane: each label is one of its face's, and -1 only without any."""
    mesh, rng = plane(12), np.random.default_rng(1)
    views = strip(rng.random((len(mesh.faces), 4)))
    hidden = rng.random(views.photo.shape) < 0.4
    hidden = np.sort(hidden, axis=1)
    views = FaceViews(
        np.where(hidden, -1, views.photo), np.where(hidden, np.inf, views.cost),
        views.to_consensus, np.full(len(mesh.faces), 60.0, np.float32), views.partly,
        views.outlier,
    )  # fmt: skip
    graph = dual_graph(mesh)
    labels = choose_photos(mesh, views, graph, PatchOptions(seam_px=3.0))
    labels = merge_islands(labels, views, graph, np.full(len(labels), 12.0, np.float32), 40.0)
    assert ((labels < 0) == ~views.seen).all()
    assert (views.photo == labels[:, None])[views.seen].any(axis=1).all()
