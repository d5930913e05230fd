"""Ambient occlusion of vertices, by exact rays."""

from __future__ import annotations

from dataclasses import dataclass

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
    return occlusion_of(mesh, 0, len(mesh.vertices), rays, seed)


def occlusion_of(mesh: Mesh, first: int, end: int, rays: int = 64, seed: int = 0) -> Floats:
    """(end - first,) float32: those of the vertices from `first` to `end`, bit by bit as
    `ambient_occlusion` has them.
    """
    sky = _Sky.of(mesh, rays, seed)
    vertices = np.arange(first, end)
    openness = sky.openness(vertices, 1)
    closed = np.flatnonzero(openness < CLOSED)
    inside = sky.openness(vertices[closed], -1)
    turned = inside > OPEN
    openness[closed[turned]] = inside[turned]
    return openness


@dataclass(frozen=True, eq=False)
class _Sky:
    """What is asked at each vertex. shifts: (V, 2) of the directions; rays: their number."""

    surface: Surface
    caster: RayCaster
    shifts: Floats
    rays: int

    @classmethod
    def of(cls, mesh: Mesh, rays: int, seed: int) -> _Sky:
        surface, count = Surface(mesh), len(mesh.vertices)
        shifts = np.random.default_rng(seed).random((count, 2), np.float32)
        rays = max(min(rays, MAX_RAYS // max(count, 1)), min(rays, MIN_RAYS))
        return cls(surface, RayCaster(surface.xyz_in_local, mesh.faces), shifts, rays)

    def openness(self, vertices: NDArray[np.intp], side: int) -> Floats:
        """(m,) the part of the cosine-weighted rays that leave the mesh at vertices (m,), around
        their normals times `side`.
        """
        surface, rays = self.surface, self.rays
        lift = np.float32(LIFT * surface.mesh.diagonal)
        out = np.ones(len(vertices), np.float32)
        step = max(1, CHUNK // rays)
        for start in range(0, len(vertices), step):
            part = vertices[start : start + step]
            n = side * surface.normal_in_world[part]
            directions = cosine_directions(n, self.shifts[part], rays)
            origins = np.repeat(surface.xyz_in_local[part] + lift * n, rays, axis=0)
            blocked = self.caster.blocked(origins, directions.reshape(-1, 3)).reshape(-1, rays)
            known = np.einsum("ij,ij->i", n, n) > 0
            out[start : start + step] = np.where(known, 1 - blocked.mean(axis=1), 1)
        return out
