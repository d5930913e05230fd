"""The light that comes to the vertices of a mesh from far away, and from the mesh itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from texproj.appearance.relight.environment import Environment
from texproj.appearance.transfer import LIFT
from texproj.arrays import Floats
from texproj.mesh import Mesh
from texproj.render.directions import cosine_directions
from texproj.render.rays import CHUNK, RayCaster
from texproj.render.surface import Surface

MOST_RAYS, LEAST_RAYS, ALL_RAYS = 96, 24, 12_000_000
"""Per vertex; so many fewer that all are at most these, where the mesh is large: 10 s."""
BOUNCES = 3
"""The fourth would add less than a tenth of a percent to a gray surface half enclosed."""


class Obstacles:
    """Rays from a mesh to what might light it. normals: (V, 3) unit, of its vertices."""

    def __init__(self, mesh: Mesh, normals: Floats) -> None:
        surface = Surface(mesh)
        self.faces, self.offset = mesh.faces, surface.offset
        self.xyz, self.normals = surface.xyz_in_local, normals
        self.caster = RayCaster(self.xyz, mesh.faces)
        self.lift = np.float32(LIFT * mesh.diagonal)

    def clear(self, xyz: Floats, normals: Floats, toward: Floats, reach: Floats) -> Floats:
        """(n,) 1 where nothing lies within `reach` (n,) of points (n, 3) of the surface, relative
        to the mesh's center, in direction `toward` (n, 3); else 0.
        """
        out = np.zeros(len(xyz), np.float32)
        rows = np.flatnonzero(np.einsum("nc,nc->n", normals, toward) > 0)
        origins = xyz[rows] + self.lift * normals[rows]
        out[rows] = ~self.caster.blocked(origins, toward[rows], reach[rows])
        return out


@dataclass(frozen=True, eq=False)
class Radiosity:
    """sky: (V, 3) irradiance from far away; gather: (V, V) irradiance by the radiosity over pi of
    other vertices; openness: (V,) part of the sky that is seen, cosine-weighted.
    """

    sky: Floats
    gather: sparse.csr_matrix
    openness: Floats

    @classmethod
    def of(cls, obstacles: Obstacles, environment: Environment | None) -> Radiosity:
        """By cosine-distributed rays from each vertex, as `appearance.transfer` has them; what they
        meet counts as its nearest vertex.
        """
        count = len(obstacles.xyz)
        rays = int(np.clip(ALL_RAYS // max(count, 1), LEAST_RAYS, MOST_RAYS))
        shifts = np.random.default_rng(0).random((count, 2), np.float32)
        sky = np.zeros((count, 3), np.float32)
        openness = np.empty(count, np.float32)
        met, starts = [], [0]
        step = max(1, CHUNK // rays)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            normals = obstacles.normals[part]
            directions = cosine_directions(normals, shifts[part], rays).reshape(-1, 3)
            origins = np.repeat(obstacles.xyz[part] + obstacles.lift * normals, rays, 0)
            hits = obstacles.caster.first(origins, directions)
            free = (hits.face < 0).reshape(-1, rays)
            openness[part] = free.mean(axis=1)
            if environment is not None:
                arriving = environment.soft(directions) * free.reshape(-1, 1)
                sky[part] = np.pi * arriving.reshape(-1, rays, 3).mean(axis=1)
            rows = np.flatnonzero(hits.face >= 0)
            weights = np.stack([1 - hits.u[rows] - hits.v[rows], hits.u[rows], hits.v[rows]])
            met.append(obstacles.faces[hits.face[rows], weights.argmax(axis=0)])
            starts.extend((starts[-1] + np.cumsum((~free).sum(axis=1))).tolist())
        columns = np.concatenate(met)
        values = np.full(len(columns), np.pi / rays, np.float32)
        gather = sparse.csr_matrix((values, columns, np.array(starts)), (count, count))
        return cls(sky, gather, openness)

    def around(self, direct: Floats, base: Floats) -> Floats:
        """(V, 3) irradiance but for what comes from the lamps straight.

        direct: (V, 3) irradiance by lamps; base: (V, 3) reflectance of the surface, taken for
        matte.
        """
        soft = self.sky
        for _ in range(BOUNCES):
            soft = self.sky + self.gather @ (base / np.float32(np.pi) * (soft + direct))
        out: Floats = soft.astype(np.float32)
        return out
