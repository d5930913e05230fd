"""Ambient occlusion and visibility against answers known on paper."""

import numpy as np
import pytest
import trimesh

from texproj.mesh import Mesh, vertex_normals
from texproj.render import Visibility, ambient_occlusion

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


def shelf() -> tuple[Mesh, np.ndarray]:
    """A floor z = 0 over [0, 4]^2 under a shelf z = 1 over [1, 2] x [0, 4], and floor points."""
    floor = grid_mesh((0, 0, 0), (4, 0, 0), (0, 4, 0), 8)
    board = grid_mesh((1, 0, 1), (1, 0, 0), (0, 4, 0), 1)
    points = np.random.default_rng(0).random((5000, 3)) * (4, 4, 0)
    return joined(floor, board), points


@pytest.mark.parametrize("with_normals", [True, False])
@pytest.mark.parametrize("offset", [np.zeros(3), UTM], ids=["origin", "UTM"])
def test_a_shelf_hides_its_shadow(with_normals, offset):
    """From (1.5, 2, 2) a shelf at half height hides the floor from x = 0.5 to x = 2.5."""
    mesh, points = shelf()
    mesh = Mesh(mesh.vertices + offset, mesh.faces)
    normals = np.tile([0.0, 0, 1], (len(points), 1)) if with_normals else None
    seen = Visibility(mesh).seen(offset + np.array([1.5, 2, 2]), points + offset, normals)
    x = points[:, 0]
    hidden = (x > 0.5) & (x < 2.5)
    clear = np.minimum(abs(x - 0.5), abs(x - 2.5)) > 0.005
    assert (seen == ~hidden)[clear].all()


def test_grazing_points_see_the_camera():
    """At 0.5 degrees above a plane its own faces hide nothing."""
    mesh = grid_mesh((0, 0, 0), (4, 0, 0), (0, 4, 0), 50)
    points = np.random.default_rng(0).random((5000, 3)) * (4, 4, 0)
    normals = np.tile([0.0, 0, 1], (len(points), 1))
    center = np.array([-40, 2, 44 * np.tan(np.radians(0.5))])
    assert Visibility(mesh).seen(center, points, normals).all()


def test_points_that_face_away_are_not_seen():
    """On a ball the far half, by the normal alone, and nothing of the near half is lost."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    mesh = Mesh(ball.vertices, ball.faces)
    normals = vertex_normals(mesh)
    seen = Visibility(mesh).seen((5, 0, 0), mesh.vertices, normals)
    cosine = np.einsum("ij,ij->i", normals, np.array([5.0, 0, 0]) - mesh.vertices)
    assert (seen == (cosine > 0))[np.abs(cosine) > 0.05].all()


def test_many_points_pass_in_chunks(monkeypatch):
    """The answer does not depend on the size of a chunk."""
    mesh, points = shelf()
    whole = Visibility(mesh).seen((1.5, 2, 2), points)
    monkeypatch.setattr("texproj.render.occlusion.CHUNK", 77)
    assert np.array_equal(Visibility(mesh).seen((1.5, 2, 2), points), whole)
    assert np.array_equal(ambient_occlusion(mesh, 20), ambient_occlusion(mesh, 20))
