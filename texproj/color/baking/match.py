"""The point of a mesh that a point near it stands for: along the normal, to the nearer side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from texproj.arrays import Doubles, Floats
from texproj.mesh import Mesh, face_normals, vertex_normals
from texproj.render.rays import RayCaster

LIFT = 1e-5
"""How far rays start on the other side of the point, as a part of the diagonal: what lies on the
surface is met."""
FARTHEST = 0.02
"""Of the diagonal: what lies farther off is another part of the surface."""
LEAST_COSINE = 0.2
"""Between the two surfaces; other sides of thin walls are turned away."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places on a mesh: face (n,) int32; weights (n, 3) float32 of its corners."""

    face: NDArray[np.int32]
    weights: Floats


class Matcher:
    """A mesh whose surface is looked for."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._xyz = mesh.vertices - mesh.center
        self._caster = RayCaster(self._xyz, mesh.faces)
        self._normals = face_normals(mesh).astype(np.float32)
        self._vertex_normals = vertex_normals(mesh).astype(np.float32)
        self._tree: cKDTree | None = None

    def places(self, xyz: Floats, normals: Floats) -> Places:
        """Where points (n, 3), relative to the mesh's center, lie on it. normals: (n, 3) unit."""
        lift, far = (part * self.mesh.diagonal for part in (LIFT, FARTHEST))
        face = np.full(len(xyz), -1, np.int32)
        nearest = np.full(len(xyz), far, np.float32)
        weights = np.zeros((len(xyz), 3), np.float32)
        for sign in (1, -1):
            along = sign * normals
            hits = self._caster.first(xyz - lift * along, along)
            met = hits.face >= 0
            facing = np.einsum("ij,ij->i", self._normals[np.maximum(hits.face, 0)], normals)
            better = met & (hits.depth - lift < nearest) & (facing > LEAST_COSINE)
            face[better], nearest[better] = hits.face[better], (hits.depth - lift)[better]
            u, v = hits.u[better], hits.v[better]
            weights[better] = np.stack([1 - u - v, u, v], axis=1)
        lost = np.flatnonzero(face < 0)
        if len(lost):
            face[lost], weights[lost] = self._nearest_corners(xyz[lost])
        return Places(face, weights)

    def _nearest_corners(self, xyz: Floats) -> tuple[NDArray[np.int32], Floats]:
        """A face at the nearest vertex of each point, with all weight on that."""
        if self._tree is None:
            self._used, first = np.unique(self.mesh.faces.ravel(), return_index=True)
            self._corner = first
            self._tree = cKDTree(self._xyz[self._used])
        corner = self._corner[self._tree.query(xyz)[1]]
        return (corner // 3).astype(np.int32), np.eye(3, dtype=np.float32)[corner % 3]

    def normals_at(self, places: Places) -> Floats:
        """(n, 3) unit normals of the surface, interpolated between vertices."""
        corners = self._vertex_normals[self.mesh.faces[places.face]]
        blended = np.einsum("nk,nkc->nc", places.weights, corners)
        size = np.sqrt(np.einsum("ij,ij->i", blended, blended))
        return (blended / np.maximum(size, np.float32(1e-20))[:, None]).astype(np.float32)


def mixed(corners: Floats | Doubles, weights: Floats) -> Floats:
    """(n, c) values of corners (n, 3, c) by weights (n, 3)."""
    return np.einsum("nk,nkc->nc", weights, corners).astype(np.float32)
