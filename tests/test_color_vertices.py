"""Coloring vertices, on planes whose colors are known on paper."""

import numpy as np
import pytest
from color_scenes import SIZE, camera, joined, moved, pattern, picture, plane
from photo_sets import photo_set

from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.vertices import color_vertices
from texproj.errors import InputError
from texproj.mesh import Mesh
from texproj.options import ColorOptions, RenderOptions
from texproj.render import open_renderer

VIEWS = ((0.3, 0.2, 3.0), (-0.9, 0.4, 2.8), (0.8, -0.7, 2.6), (-0.2, -0.9, 3.1))
RESAMPLING = 0.004
"""Linear light: the pattern's curvature over a vertex' footprint and 16-bit rounding."""


@pytest.fixture(scope="module", params=["gl", "cpu"])
def renderer(request):
    with open_renderer(RenderOptions(renderer=request.param)) as renderer:
        yield renderer


@pytest.fixture(scope="module")
def cpu():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


def truth(mesh):
    return pattern(mesh.vertices[:, 0], mesh.vertices[:, 1])


def color(mesh, cameras, photos, renderer, **options):
    return color_vertices(mesh, photo_set(cameras, photos), renderer, ColorOptions(**options))


def test_colors_are_those_of_the_surface(renderer):
    """Vertices seen by several photos get the pattern's color, with either renderer."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]
    result = color(mesh, cameras, [picture(c) for c in cameras], renderer)
    sure = result.photo_count > 1
    assert sure.mean() > 0.9
    assert np.abs(result.rgb - truth(mesh))[sure].max() < RESAMPLING


def test_a_mesh_that_is_seen_from_behind_is_refused(cpu):
    """Nothing would get its color; where a third faces the photos, that third does."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]
    photos = [picture(c) for c in cameras]
    inside_out = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    with pytest.raises(InputError, match="100% of what is seen of it is its back"):
        color(inside_out, cameras, photos, cpu)
    rows = np.arange(len(mesh.faces)) % 3 == 0
    mixed = Mesh(mesh.vertices, np.where(rows[:, None], mesh.faces, mesh.faces[:, ::-1]))
    colored = color(mixed, cameras, photos, cpu)
    assert colored.photo_count.any()
    assert colored.quality["behind"] == pytest.approx(2 / 3, abs=0.03)
    assert color(mesh, cameras, photos, cpu).quality["behind"] == 0


def test_renderers_agree():
    """Visibility by OpenGL and by ray casting gives the same weights up to the pixels of edges."""
    mesh = joined(plane(), plane(8, z=0.4, half=0.3))
    cameras = [camera(c) for c in VIEWS]
    photos = [picture(c) for c in cameras]
    results = []
    for kind in ("gl", "cpu"):
        with open_renderer(RenderOptions(renderer=kind)) as renderer:
            results.append(color(mesh, cameras, photos, renderer))
    flipped = results[0].photo_count != results[1].photo_count
    assert flipped.mean() < 0.01
    assert np.abs(results[0].rgb - results[1].rgb)[~flipped].max() < 0.01


def test_back_faces_get_nothing(cpu):
    """A surface that faces away has weight 0 everywhere, beside one that does not."""
    view = camera(VIEWS[0])
    mesh = joined(plane(up=False), plane(8, z=0.4, half=0.5))
    result, away = color(mesh, [view], [picture(view)], cpu), mesh.vertices[:, 2] == 0
    assert not result.weight[away].any() and not result.photo_count[away].any()
    assert result.weight[~away].all()


def test_never_through_occluders(cpu):
    """Behind a smaller plane nothing is seen, beside it everything; its own color stays off."""
    view = camera((0, 0, 3.0))
    mesh = joined(plane(), plane(8, z=1.0, half=0.4))
    result = color(mesh, [view], [picture(view)], cpu)
    low = mesh.vertices[:, 2] == 0
    radius = np.abs(mesh.vertices[:, :2]).max(axis=1)
    assert not result.weight[low & (radius < 0.55)].any()  # shadow: 0.4 * 3 / 2 = 0.6
    assert (result.weight[low & (radius > 0.65) & (np.abs(mesh.vertices[:, 1]) < 0.9)] > 0).all()
    assert (result.weight[~low] > 0).all()


def test_unseen_is_filled_but_stays_unseen(cpu):
    """A vertex outside of every picture keeps weight 0 and takes a neighbor's color, not black."""
    view = camera((0, 0, 3.0), focal=500.0)
    result = color(plane(), [view], [picture(view)], cpu)
    unseen = result.weight == 0
    assert 0.1 < unseen.mean() < 0.9
    assert result.rgb[unseen].min() > 0.14
    assert result.quality["seen"] == pytest.approx(1 - unseen.mean())


def test_gains_are_recovered(cpu):
    """Photos a stop apart and tinted give their gains within 1 %, and colors without seams."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]
    gains = np.array([[1, 1, 1], [0.5, 0.5, 0.5], [1.3, 1.2, 0.9], [0.8, 0.7, 0.95]])
    photos = [picture(c, gain=g) for c, g in zip(cameras, gains, strict=True)]
    result = color(mesh, cameras, photos, cpu)
    found = np.array([p["gain"] for p in result.quality["photos"]])
    expected = np.exp(np.log(gains).mean(0)) / gains
    assert np.abs(found / expected - 1).max() < 0.01
    sure = result.photo_count > 1
    relative = result.rgb[sure] / (truth(mesh)[sure] * np.exp(np.log(gains).mean(0)))
    assert np.abs(relative - 1).max() < 0.02


def test_a_moving_thing_is_left_out(cpu):
    """Something bright before the surface in one of four photos leaves no trace."""
    mesh, cameras = plane(), [camera(c) for c in VIEWS]

    def with_visitor(x, y):
        inside = (np.abs(x) < 0.3) & (np.abs(y - 0.1) < 0.3)
        return np.where(inside[..., None], (0.9, 0.85, 0.05), pattern(x, y))

    photos = [picture(c, with_visitor if i == 1 else pattern) for i, c in enumerate(cameras)]
    hit = np.abs(mesh.vertices[:, :2] - (0, 0.1)).max(axis=1) < 0.25
    robust = color(mesh, cameras, photos, cpu)
    plain = color(mesh, cameras, photos, cpu, blend="mean")
    assert np.abs(plain.rgb - truth(mesh))[hit].max() > 0.1
    assert np.abs(robust.rgb - truth(mesh))[hit].max() < 0.03


def test_masked_pixels_are_never_used(cpu):
    """Under a stencil the weight is 0, and no masked color leaks out."""
    view = camera((0, 0, 3.0))
    mask = np.full(SIZE[::-1], 255, np.uint8)
    mask[:, : SIZE[0] // 2] = 0
    photo = picture(view, lambda x, y: np.where((x < 0)[..., None], (1.0, 0, 0), (0.2, 0.4, 0.6)))
    photo = type(photo)(photo.info, photo.pixels, mask)
    mesh = plane()
    result = color(mesh, [view], [photo], cpu)
    seen = result.weight > 0
    assert 0.3 < seen.mean() < 0.6
    xy_px, _ = view.project(mesh.vertices[seen])
    assert (xy_px[:, 0] > SIZE[0] // 2).all()


def test_large_coordinates_lose_nothing(cpu):
    """The same scene at UTM coordinates gives the same colors and weights."""
    results = []
    for offset in ((0, 0, 0), (512_000.0, 5_403_000.0, 250.0)):
        cameras = [camera(c, offset=offset) for c in VIEWS[:2]]
        photos = [picture(camera(c)) for c in VIEWS[:2]]
        results.append(color(moved(plane(), offset), cameras, photos, cpu))
    assert np.array_equal(results[0].photo_count, results[1].photo_count)
    assert np.abs(results[0].rgb - results[1].rgb).max() < 1e-3


def test_lens_distortion_is_followed(renderer):
    """Photos through a strongly bent lens give the same colors as those of a pinhole."""
    mesh = plane()
    dist = (-0.25, 0.08, 0.002, -0.001, 0.0)
    cameras = [camera(c, dist=dist) for c in VIEWS]
    result = color(mesh, cameras, [picture(c) for c in cameras], renderer)
    sure = result.photo_count > 1
    assert sure.mean() > 0.9
    assert np.abs(result.rgb - truth(mesh))[sure].max() < RESAMPLING


def test_photos_are_read_once_and_one_that_cannot_be_is_named(cpu):
    """Each photo is asked for exactly once; why one was left out is part of the result."""
    mesh, cameras, asked, told = plane(), [camera(c) for c in VIEWS], [], []

    def read(name):
        asked.append(name)
        if name == "c":
            raise InputError("c is damaged")
        return picture(cameras["abcd".index(name)])

    photos = PhotoSet(tuple("abcd"), tuple(cameras), read)
    result = color_vertices(mesh, photos, cpu, progress=lambda *x: told.append(x))
    assert sorted(asked) == list("abcd")
    assert told[-1] == (4, 4)
    assert result.photo_count.max() == 3
    assert result.failed == {"c": "c is damaged"}
    assert [row["file"] for row in result.quality["photos"]] == ["a", "b", "d"]


def test_what_is_not_the_photos_fault_is_not_called_so(cpu):
    """A lack of memory ends the work; it does not leave a photo out."""

    def read(_):
        raise MemoryError

    with pytest.raises(MemoryError):
        color_vertices(plane(), PhotoSet(("a",), (camera(VIEWS[0]),), read), cpu)
