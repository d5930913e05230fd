"""Ambient occlusion of vertices, by exact rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.mesh import Mesh
from texproj.render.directions import cosine_directions
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
        directions = cosine_directions(n, shifts[part], rays)
        origins = np.repeat(surface.xyz_in_local[part] + lift * n, rays, axis=0)
        blocked = caster.blocked(origins, directions.reshape(-1, 3)).reshape(-1, rays)
        known = np.einsum("ij,ij->i", n, n) > 0
        out[start : start + step] = np.where(known, 1 - blocked.mean(axis=1), 1)
    return out
