"""Ambient occlusion of vertices, by exact rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.mesh import Mesh
from texproj.render.rays import CHUNK, RayCaster
from texproj.render.surface import Surface

LIFT = 1e-4
"""How far rays start above the surface, as a part of the diagonal: far above float32 rounding
(1e-7), below what a photo resolves."""

MAX_RAYS = 1 << 25
"""Rays for one mesh in all (about 15 s); larger meshes get fewer rays per vertex."""

MIN_RAYS = 8

CLOSED, OPEN = 0.02, 0.25
"""A vertex whose outside is more closed and whose inside is more open than this faces inwards."""


def ambient_occlusion(mesh: Mesh, rays: int = 64, seed: int = 0) -> Floats:
    """(V,) float32: the part of the sky that each vertex sees, cosine-weighted; 1 = all of it.

    `rays` per vertex, fewer (at least `MIN_RAYS`) where there would be more than `MAX_RAYS` in all.
    The directions are Roberts' R2 sequence, turned by a random shift per vertex (Cranley and
    Patterson 1976), the same for the same seed. Rays have no end: inside of a closed room all is
    dark. Vertices whose outside is closed and whose inside is open are taken as turned inside out
    and measured on the other side; vertices without a normal are 1.
    """
    surface = Surface(mesh)
    caster = RayCaster(surface.xyz_in_local, mesh.faces)
    rays = max(min(rays, MAX_RAYS // max(len(mesh.vertices), 1)), min(rays, MIN_RAYS))
    shifts = np.random.default_rng(seed).random((len(mesh.vertices), 2), np.float32)
    normals = surface.normal_in_world
    openness = _openness(surface, caster, normals, shifts, rays)
    closed = np.flatnonzero(openness < CLOSED)
    inside = _openness(surface, caster, -normals, shifts, rays, closed)
    turned = inside > OPEN
    openness[closed[turned]] = inside[turned]
    return openness


def _openness(
    surface: Surface,
    caster: RayCaster,
    normals: Floats,
    shifts: Floats,
    rays: int,
    chosen: NDArray[np.intp] | None = None,
) -> Floats:
    """(m,) the part of the cosine-weighted rays around `normals` that leave the mesh."""
    chosen = np.arange(len(normals)) if chosen is None else chosen
    lift = np.float32(LIFT * surface.mesh.diagonal)
    out = np.ones(len(chosen), np.float32)
    step = max(1, CHUNK // rays)
    for start in range(0, len(chosen), step):
        part = chosen[start : start + step]
        n = normals[part]
        directions = _cosine_directions(n, shifts[part], rays)
        origins = np.repeat(surface.xyz_in_local[part] + lift * n, rays, axis=0)
        blocked = caster.blocked(origins, directions.reshape(-1, 3)).reshape(-1, rays)
        known = np.einsum("ij,ij->i", n, n) > 0
        out[start : start + step] = np.where(known, 1 - blocked.mean(axis=1), 1)
    return out


def _cosine_directions(normals: Floats, shifts: Floats, rays: int) -> Floats:
    """(m, rays, 3) unit vectors, cosine-distributed around unit `normals` (m, 3)."""
    golden = np.array([0.7548776662466927, 0.5698402909980532])  # 1/g, 1/g^2 with g^3 = g + 1
    points = (np.arange(1, rays + 1)[:, None] * golden + 0.5).astype(np.float32)
    u = (points[None] + shifts[:, None]) % 1
    radius, angle = np.sqrt(u[..., 0]), np.float32(2 * np.pi) * u[..., 1]
    height = np.sqrt(np.maximum(1 - u[..., 0], 0))
    b1, b2 = _tangents(normals)
    across = (radius * np.cos(angle))[..., None] * b1[:, None]
    along = (radius * np.sin(angle))[..., None] * b2[:, None]
    return across + along + height[..., None] * normals[:, None]


def _tangents(n: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors square to each unit vector of (m, 3). Duff et al., JCGT 6(1), 2017."""
    x, y, z = n.T
    sign = np.copysign(np.float32(1), z)
    a = -1 / (sign + z)
    b = x * y * a
    b1 = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    return b1, np.stack([b, sign + y * y * a, -y], axis=1)
