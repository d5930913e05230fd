"""The part of the surface that a vertex's color is an average of: a third of each face around it.

A shadow's edge runs through many of them, and where the surface bends its faces look to other parts
of the sky: light that is to be divided out of such a color has to be averaged over the same part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles, Floats, Index
from texproj.mesh import Mesh, face_areas

STEPS = (0.8191725134, 0.6710436067)
"""Of a sequence that fills a square evenly: R3 without its first, which is stratified (Roberts,
"The unreasonable effectiveness of quasirandom sequences", 2018).
"""


@dataclass(frozen=True, eq=False)
class Spots:
    """k points for each of n vertices. xyz: (k, n, 3) float32, relative to the mesh's center;
    normal: (k, n, 3) float32 of length 1.
    """

    xyz: Floats
    normal: Floats


class Cells:
    """The cells of all vertices of a mesh."""

    def __init__(self, mesh: Mesh, xyz: Floats) -> None:
        """xyz: (V, 3) the mesh's vertices, relative to its center."""
        self._faces, self._xyz = mesh.faces, xyz
        corners = mesh.faces.ravel()
        self._order = np.argsort(corners, kind="stable")
        self._first = np.searchsorted(corners[self._order], np.arange(len(xyz) + 1))
        area = np.maximum(face_areas(mesh), 1e-30)
        self._area: Doubles = np.concatenate([[0], np.cumsum(area[self._order // 3])])
        self._shifts = np.random.default_rng(0).random((len(xyz), 3))

    def spots(self, vertices: Index, count: int) -> Spots:
        """`count` points of each cell, evenly spread, the same whatever else is asked for.

        Each vertex has a face.
        """
        xyz = np.empty((count, len(vertices), 3), np.float32)
        normal = np.empty_like(xyz)
        for number in range(count):
            xyz[number], normal[number] = self._spots(vertices, number, count)
        return Spots(xyz, normal)

    def _spots(self, vertices: Index, number: int, count: int) -> tuple[Floats, Floats]:
        """(n, 3) the point of a number in each cell, and the normal of its face."""
        shift = self._shifts[vertices]
        low, high = self._first[vertices], self._first[vertices + 1]
        along = (number + shift[:, 0]) / count
        place = self._area[low] + along * (self._area[high] - self._area[low])
        at = np.searchsorted(self._area, place, side="right") - 1
        at = self._order[np.clip(at, low, high - 1)]
        face, corner = self._faces[at // 3], at % 3
        a, b, c = (self._xyz[face[np.arange(len(at)), (corner + k) % 3]] for k in range(3))
        u, v = (((number + 1) * step + shift[:, 1 + k]) % 1 for k, step in enumerate(STEPS))
        root = np.sqrt(u)
        part = np.sort(np.stack([1 - root, root * (1 - v), root * v]), axis=0).astype(np.float32)
        part[:2] = part[:2] if number % 2 else part[1::-1]
        xyz = a * part[2][:, None] + b * part[0][:, None] + c * part[1][:, None]
        normal = np.cross(b - a, c - a)
        return xyz, normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20)
