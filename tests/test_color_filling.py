"""Colors for what no photo sees: a membrane that hangs on what is seen."""

import numpy as np
import pytest

from texproj.color.filling.texels import BESIDE, ELSEWHERE, FADE, RING, from_unseen
from texproj.color.filling.vertices import fill_vertices
from texproj.mesh import Mesh

SIDE = 60


def sheet(side=SIDE, jitter=0.0):
    """A flat square of triangles, its vertices moved by up to `jitter` of a step."""
    x, y = (v.ravel() for v in np.meshgrid(np.arange(side), np.arange(side)))
    xyz = np.stack([x, y, 0 * x], axis=1).astype(float)
    xyz[:, :2] += np.random.default_rng(0).uniform(-jitter, jitter, (len(xyz), 2))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    one = np.stack([corner, corner + 1, corner + side], axis=1)
    two = np.stack([corner + 1, corner + side + 1, corner + side], axis=1)
    return Mesh(xyz, np.concatenate([one, two]))


def hole(mesh, radius):
    """(V,) bool: seen but for a disc in the middle."""
    return np.linalg.norm(mesh.vertices[:, :2] - SIDE / 2, axis=1) > radius


def test_what_is_seen_stays():
    """Not a bit of it changes."""
    mesh = sheet()
    rgb = np.random.default_rng(1).random((len(mesh.vertices), 3), np.float32)
    seen = hole(mesh, 20)
    np.testing.assert_array_equal(fill_vertices(mesh, rgb, seen)[seen], rgb[seen])
    np.testing.assert_array_equal(fill_vertices(mesh, rgb, seen | True), rgb)


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_a_gradient_goes_on_through_a_hole(jitter):
    """A linear function is harmonic, on triangles of any shape: the disc gets its very values."""
    mesh = sheet(jitter=jitter)
    rgb = (mesh.vertices @ [[0.01, 0, 0.004], [0, 0.01, 0.004], [0, 0, 0]]).astype(np.float32)
    found = fill_vertices(mesh, rgb, hole(mesh, 25))
    assert np.abs(found - rgb).max() < 0.01  # weights of slivers are bounded


def test_detail_of_the_border_fades():
    """Stripes end where the photos do: in the depth of the hole is one color, at its border
    no jump, and nowhere anything that is not in them.
    """
    mesh = sheet()
    stripes = (0.5 + 0.4 * np.sin(2 * np.pi * mesh.vertices[:, 1] / 8)).astype(np.float32)
    rgb, seen = np.stack([stripes] * 3, axis=1), hole(mesh, 25)
    found = fill_vertices(mesh, rgb, seen)[:, 0]
    middle = ~hole(mesh, 12)
    assert np.ptp(found[middle]) < 0.1 * np.ptp(rgb)
    a, b = mesh.faces[:, :2].T
    crossing = seen[a] != seen[b]
    assert np.abs(found[a] - found[b])[crossing].mean() < 0.15
    assert found.min() >= rgb.min() and found.max() <= rgb.max()


def test_a_part_that_no_photo_sees_takes_what_is_near():
    """Two sheets, red and blue; a third, detached and unseen, lies near the blue one."""
    one = sheet(10)
    parts = [one.vertices + np.array([x, 0, 0]) for x in (0, 100, 120)]
    faces = np.concatenate([one.faces + 100 * k for k in range(3)])
    rgb = np.zeros((300, 3), np.float32)
    rgb[:100, 0] = rgb[100:200, 2] = 1
    found = fill_vertices(Mesh(np.concatenate(parts), faces), rgb, np.arange(300) < 200)
    np.testing.assert_allclose(found[200:], [[0, 0, 1]] * 100, atol=1e-3)


def test_vertices_of_no_face_are_filled():
    """Scans have them."""
    mesh = sheet(6)
    loose = Mesh(np.concatenate([mesh.vertices, [[3, 3, 1.0]]]), mesh.faces)
    rgb = np.full((37, 3), 0.25, np.float32)
    found = fill_vertices(loose, rgb, np.arange(37) < 30)
    np.testing.assert_allclose(found, rgb, atol=1e-4)


def test_how_far_from_what_is_unseen():
    """Beside a wide gap the distance counts up to where nothing fades any more; a gap of one texel
    is unseen but nothing fades into it; what is on no chart is neither. Across strips too.
    """
    inside = np.ones((1100, 64), bool)
    inside[:, :4] = False
    count = np.full(inside.shape, 2, np.uint8)
    count[500:530, 30:40] = 0
    count[600, :] = 0
    found = from_unseen(count, inside)
    assert (found[500:530, 30:40] == 0).all()
    wanted = [*range(1, FADE + 1)] + [BESIDE] * (RING - FADE) + [ELSEWHERE]
    assert list(found[515, 40 : 40 + RING + 1]) == wanted
    assert (found[600, 4:] == 0).all()
    assert (found[601 : 601 + RING, 4:] == BESIDE).all()
    assert (found[601 + RING, 4:] == ELSEWHERE).all()
    assert (found[:, :4] == ELSEWHERE).all()
