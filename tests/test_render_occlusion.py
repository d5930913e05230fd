"""Ambient occlusion against answers known on paper."""

import numpy as np
import pytest
import trimesh

from texproj.mesh import Mesh
from texproj.render import ambient_occlusion

UTM = np.array([512_345.678, 5_412_345.678, 321.5])


def grid_mesh(origin, x_axis, y_axis, n) -> Mesh:
    """An n x n grid of quads; normals along x_axis cross y_axis."""
    s, t = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    xyz = np.asarray(origin) + s.reshape(-1, 1) * np.asarray(x_axis, float)
    xyz = xyz + t.reshape(-1, 1) * np.asarray(y_axis, float)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.stack([i, i + 1, i + n + 2, i + n + 1], axis=1)
    return Mesh(xyz, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=False)]),
    )


def floor_and_wall() -> tuple[Mesh, np.ndarray, np.ndarray]:
    """A floor, its vertices' distances from a very long wall of height 1, and their openness."""
    floor = grid_mesh((0, -0.5, 0), (3, 0, 0), (0, 1, 0), 30)
    wall = grid_mesh((0, 20, 0), (0, -40, 0), (0, 0, 1), 1)
    distance = floor.vertices[:, 0]
    # a wall seen up to elevation b hides (1 - cos b) / 2 of the cosine-weighted sky
    hidden = (1 - distance / np.hypot(distance, 1)) / 2
    return joined(floor, wall), distance, 1 - hidden


def test_openness_before_a_long_wall():
    """The view factor of an infinite wall: mean error < 0.004, spread < 0.03 at 256 rays."""
    mesh, distance, expected = floor_and_wall()
    ao = ambient_occlusion(mesh, rays=256)[: len(distance)]
    error = (ao - expected)[distance > 0.05]
    assert abs(error.mean()) < 0.004
    assert error.std() < 0.03


def test_more_rays_are_closer():
    """The spread falls with the number of rays, faster than random directions would allow."""
    mesh, distance, expected = floor_and_wall()
    away = distance > 0.05
    spread = [
        (ambient_occlusion(mesh, rays=rays)[: len(distance)] - expected)[away].std()
        for rays in (16, 256)
    ]
    assert spread[1] < spread[0] / 4


def test_same_seed_same_values():
    """Deterministic; another seed turns the directions."""
    mesh, _, _ = floor_and_wall()
    assert np.array_equal(ambient_occlusion(mesh, 32), ambient_occlusion(mesh, 32))
    assert not np.array_equal(ambient_occlusion(mesh, 32), ambient_occlusion(mesh, 32, seed=1))


@pytest.mark.parametrize("order", [slice(None), slice(None, None, -1)], ids=["outward", "inward"])
def test_a_ball_is_open_whichever_way_its_faces_turn(order):
    """Convex: every vertex sees all of the sky; turned inside out it is the same ball."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    ao = ambient_occlusion(Mesh(np.asarray(ball.vertices) + UTM, ball.faces[:, order]))
    assert ao.dtype == np.float32
    assert ao.min() > 0.97


def test_vertices_without_normal_are_open():
    """A vertex in no face hides nothing and is hidden by nothing."""
    mesh, _, _ = floor_and_wall()
    mesh = Mesh(np.concatenate([mesh.vertices, [[1.0, 0.0, 0.5]]]), mesh.faces)
    assert ambient_occlusion(mesh, 16)[-1] == 1


def test_the_size_of_a_chunk_changes_nothing(monkeypatch):
    mesh = grid_mesh((0, 0, 0), (4, 0, 0), (0, 4, 0), 8)
    mesh = joined(mesh, grid_mesh((1, 0, 1), (1, 0, 0), (0, 4, 0), 3))
    whole = ambient_occlusion(mesh, 20)
    assert 0 < whole.min() < 0.9
    monkeypatch.setattr("texproj.render.occlusion.CHUNK", 77)
    assert np.array_equal(ambient_occlusion(mesh, 20), whole)
