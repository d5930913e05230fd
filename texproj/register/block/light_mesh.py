"""A mesh of fewer faces in place of one of millions: blocks are compared with it at the size of
reduced photos, where the difference is not seen.

Vertices in one cell of a grid become one (Rossignac and Borrel, "Multi-resolution 3D approximations
for rendering complex scenes", 1993): rough, but in seconds, which edge collapse is not.
"""

from __future__ import annotations

import numpy as np

from texproj.mesh import Mesh, face_areas, face_cross

MOST_FACES = 600_000
"""Meshes with fewer are used as they are."""
LIGHT_FACES = 350_000
"""About so many are left: a pixel of a reduced photo each, where the mesh fills it."""
PROBED = 200_000
"""Faces from which the surface's area is told."""


def light_mesh(mesh: Mesh) -> Mesh:
    """About `LIGHT_FACES` faces of the same shape; the mesh itself if it has few."""
    if len(mesh.faces) <= MOST_FACES:
        return mesh
    step = max(1, len(mesh.faces) // PROBED)
    area = step * float(face_areas(Mesh(mesh.vertices, mesh.faces[::step])).sum())
    return clustered(mesh, float(np.sqrt(2 * area / LIGHT_FACES)))


def clustered(mesh: Mesh, cell: float) -> Mesh:
    """The mesh with the vertices of each cube of edge `cell`, mesh units, in their mean; its faces
    look to the side to which they did.
    """
    where = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / cell).astype(np.int64)
    x, y, z = where.T
    size = where.max(axis=0) + 1
    number = np.unique((x * size[1] + y) * size[2] + z, return_inverse=True)[1]
    count = np.bincount(number)
    means = [np.bincount(number, column) / count for column in mesh.vertices.T]
    faces = number[mesh.faces].astype(np.int32)
    a, b, c = faces.T
    left = np.flatnonzero((a != b) & (b != c) & (c != a))
    vertices, faces = np.stack(means, axis=1), faces[left]
    before, now = face_cross(mesh.vertices, mesh.faces[left]), face_cross(vertices, faces)
    turned = np.einsum("ij,ij->i", now, before) < 0
    faces[turned] = faces[turned, ::-1]
    return Mesh(vertices, faces)
