"""A mesh of millions of faces made light: the same surface, within what a reduced photo shows."""

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from texproj.mesh import Mesh, face_areas, face_cross
from texproj.register.block import light_mesh as module
from texproj.register.block.light_mesh import clustered, light_mesh


def ball(subdivisions):
    solid = trimesh.creation.icosphere(subdivisions)
    return Mesh(np.asarray(solid.vertices), np.asarray(solid.faces, np.int32))


def test_a_light_mesh_has_about_the_faces_that_are_wanted(monkeypatch):
    """Within a factor of 1.5, none of them degenerate; the surface stays where it was, within a
    part of a cell, and keeps its area.
    """
    monkeypatch.setattr(module, "MOST_FACES", 20_000)
    monkeypatch.setattr(module, "LIGHT_FACES", 8_000)
    mesh = ball(6)
    light = light_mesh(mesh)

    assert 8_000 / 1.5 < len(light.faces) < 8_000 * 1.5
    assert face_areas(light).min() > 0
    assert np.abs(np.linalg.norm(light.vertices, axis=1) - 1).max() < 0.01
    assert abs(face_areas(light).sum() / (4 * np.pi) - 1) < 0.02
    assert cKDTree(light.vertices).query(mesh.vertices)[0].max() < 0.1


def test_faces_look_outwards_as_they_did():
    """Also thin ones, which fold over as their corners are moved together."""
    rng = np.random.default_rng(0)
    mesh = ball(5)
    rough = Mesh(mesh.vertices * rng.uniform(0.99, 1.01, (len(mesh.vertices), 1)), mesh.faces)
    light = clustered(rough, 0.15)
    cross = face_cross(light.vertices, light.faces)

    assert (np.einsum("ij,ij->i", cross, light.vertices[light.faces[:, 0]]) > 0).mean() > 0.995


def test_a_mesh_of_few_faces_is_itself():
    """Nothing is lost where nothing is gained."""
    mesh = ball(3)
    assert light_mesh(mesh) is mesh


def test_faces_that_fall_into_one_cell_go():
    """What is smaller than a cell vanishes; what is left has no face with a vertex twice."""
    dust = Mesh(np.array([(0, 0, 0), (0.01, 0, 0), (0, 0.01, 0), (3, 0, 0), (0, 3, 0)], float),
                np.array([(0, 1, 2), (1, 3, 4)], np.int32))  # fmt: skip
    light = clustered(dust, 1.0)

    assert len(light.vertices) == 3
    assert sorted(light.faces[0].tolist()) == [0, 1, 2]
    assert len(light.faces) == 1
