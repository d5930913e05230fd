"""Faces split for a lens: nothing is lost, nothing opens, nothing stays too long."""

import numpy as np
import pytest
import trimesh

from texproj.render.geometry import along_curve
from texproj.render.tessellation import Tessellation, Viewpoint

VIEW = Viewpoint(np.zeros(3, np.float32), np.array([0, 0, 1], np.float32), 0.01)


def coarse() -> Tessellation:
    """A box with edges of many lengths, ahead of the viewpoint, its faces in another order."""
    box = trimesh.creation.box((2, 1, 0.3)).subdivide()
    xyz = (np.asarray(box.vertices) * [1, 2, 1] + [0.3, -0.2, 3]).astype(np.float32)
    order = np.random.default_rng(0).permutation(len(box.faces)).astype(np.int32)
    return Tessellation(xyz, box.faces[order].astype(np.int32), order)


def spans(mesh: Tessellation) -> np.ndarray:
    """(G, 3) length of each edge over the smallest distance of its ends."""
    a, b = mesh.xyz[mesh.faces], mesh.xyz[np.roll(mesh.faces, -1, axis=1)]
    nearest = np.minimum(np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1))
    return np.linalg.norm(b - a, axis=-1) / nearest


@pytest.mark.parametrize("limit", [0.5, 0.2, 0.05])
def test_splitting_keeps_the_surface(limit):
    """No edge spans more than the limit; area, closedness, orientation and parents are kept."""
    whole = coarse()
    fine = whole.refined(VIEW, limit)
    before = trimesh.Trimesh(whole.xyz, whole.faces, process=False)
    after = trimesh.Trimesh(fine.xyz, fine.faces, process=False)

    assert spans(fine).max() <= limit * 1.0001
    assert len(fine.faces) < 6 * len(whole.faces) * max(1, (spans(whole).max() / limit) ** 2)
    assert after.is_watertight
    assert after.volume == pytest.approx(before.volume, rel=1e-5)
    area = np.bincount(fine.face_of, after.area_faces)
    np.testing.assert_allclose(area[whole.face_of], before.area_faces, rtol=1e-4)


def test_what_is_short_or_behind_stays():
    """Nothing to do gives the same mesh back; faces behind the camera are left alone."""
    whole = coarse()
    assert whole.refined(VIEW, 10.0) is whole
    behind = Tessellation(whole.xyz * [1, 1, -1], whole.faces, whole.face_of)
    assert behind.refined(VIEW, 0.01) is behind


def test_the_quick_bound_holds():
    """`largest_span` is never less than what any edge spans."""
    whole = coarse()
    for limit in (10.0, 0.3, 0.1):
        fine = whole.refined(VIEW, limit)
        assert fine.largest_span(VIEW) >= spans(fine).max() * 0.9999


def test_values_are_interpolated_at_new_vertices():
    """A linear function of the coordinates stays that function."""
    fine = coarse().refined(VIEW, 0.1)
    linear = coarse().xyz @ np.array([[1, 2], [0, 1], [3, -1]], np.float32)
    expected = fine.xyz @ np.array([[1, 2], [0, 1], [3, -1]], np.float32)
    np.testing.assert_allclose(fine.extended(linear), expected, atol=1e-5)


def test_splitting_again_goes_on_from_there():
    """Twice in steps, parents and values count from the mesh."""
    twice = coarse().refined(VIEW, 0.3).refined(VIEW, 0.1)
    assert spans(twice).max() <= 0.1 * 1.0001
    assert set(twice.face_of) == set(coarse().face_of)
    np.testing.assert_allclose(twice.extended(coarse().xyz), twice.xyz, atol=1e-6)


def test_the_curve_visits_every_face_once_and_neighbors_together():
    """A permutation that brings shuffled faces close to each other again."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    shuffled = np.random.default_rng(0).permutation(ball.faces).astype(np.int32)
    xyz = np.asarray(ball.vertices, np.float32)
    order = along_curve(xyz, shuffled)

    def jump(faces):
        return np.linalg.norm(np.diff(xyz[faces[:, 0]], axis=0), axis=1).mean()

    assert np.array_equal(np.sort(order), np.arange(len(shuffled)))
    assert jump(shuffled[order]) < jump(shuffled) / 10
