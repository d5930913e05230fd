"""Rays against a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.mesh import Mesh
from texproj.render.rays import RayCaster


@dataclass(frozen=True, eq=False)
class Hits:
    """First hits of n rays.

    found: (n,) bool; then one entry for each ray that hit: face (m,) int32,
    uv (m, 2) float32 weights of the face's 2nd and 3rd vertex, distance (m,) float32.
    """

    found: NDArray[np.bool_]
    face: NDArray[np.int32]
    uv: Floats
    distance: Floats


class Caster:
    """A mesh ready for rays. All coordinates are float32 relative to `origin`."""

    def __init__(self, mesh: Mesh, origin: NDArray[np.float64]) -> None:
        self.vertices = np.ascontiguousarray(mesh.vertices - origin, np.float32)
        self.faces = np.ascontiguousarray(mesh.faces, np.int32)
        self._rays = RayCaster(self.vertices, self.faces)

    def first_hits(self, origins: Floats, directions: Floats) -> Hits:
        """What (n, 3) rays with unit directions meet first."""
        first = self._rays.first(origins, directions)
        found = first.face >= 0
        uv = np.stack([first.u[found], first.v[found]], axis=1)
        return Hits(found, first.face[found], uv, first.depth[found])

    def blocked(self, origins: Floats, directions: Floats) -> NDArray[np.bool_]:
        """(n,) whether a ray meets anything at all."""
        return self._rays.blocked(origins, directions)

    def at(self, hits: Hits, values: Floats) -> Floats:
        """(m, c) per-vertex values (V, c) interpolated at the hits."""
        corner = self.faces[hits.face]
        u, v = hits.uv[:, :1], hits.uv[:, 1:]
        out = values[corner[:, 0]] * (1 - u - v)
        out += values[corner[:, 1]] * u
        out += values[corner[:, 2]] * v
        return out
