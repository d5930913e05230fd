"""Points on the surface that want a color: vertices, or texels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.mesh import (
    Mesh,
    blocks_summed,
    by_blocks,
    face_areas,
    face_middles,
    face_normals,
    vertex_normals,
)

CHUNK = 1 << 16
"""Points that are worked on at once: a few arrays of this length stay in the processor's cache,
and a chunk's samples from many photos stay in memory."""


@dataclass(frozen=True, eq=False)
class Owners:
    """What points share: a face's texels look the same way; a vertex owns itself.

    origin: (3,) float64 world; center: (k, 3) float32 relative to it, so that coordinates of any
    size keep their precision; normal: (k, 3) float32 unit, or zero where unknown (never seen);
    spacing: (k,) float32 edge of the square that one point stands for, mesh units.
    """

    origin: NDArray[np.float64]
    center: Floats
    normal: Floats
    spacing: Floats

    @classmethod
    def of_faces(
        cls, mesh: Mesh, spacing: NDArray[Any], normal: NDArray[Any] | None = None
    ) -> Owners:
        """The faces of a mesh, in its order. normal: (F, 3) unit, by default the faces' own."""

        def normals(rows: slice) -> Floats:
            if normal is None:
                return face_normals(Mesh(mesh.vertices, mesh.faces[rows])).astype(np.float32)
            return normal[rows].astype(np.float32)

        unit = by_blocks(len(mesh.faces), normals)
        return cls(mesh.center, face_middles(mesh), unit, spacing.astype(np.float32))

    def part(self, rows: slice) -> Self:
        """Consecutive ones of them."""
        few = self.center[rows], self.normal[rows], self.spacing[rows]
        return type(self)(self.origin, *few)


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some of the points.

    xyz: (n, 3) float32 relative to the owners' origin; owner: (n,) rows of the owners.
    """

    xyz: Floats
    owner: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.xyz)

    def part(self, rows: slice) -> Chunk:
        """Consecutive ones of the points."""
        return Chunk(self.xyz[rows], self.owner[rows])

    def take(self, rows: NDArray[np.intp]) -> Chunk:
        """Some of the points."""
        return Chunk(self.xyz.take(rows, axis=0), self.owner.take(rows))


class PointSource(Protocol):
    """Points of a whole surface, chunk by chunk."""

    @property
    def owners(self) -> Owners:
        """What the points belong to."""

    @property
    def sizes(self) -> list[int]:
        """Points of each chunk."""

    def chunk(self, number: int) -> Chunk:
        """The points of a chunk."""


@dataclass(frozen=True, eq=False)
class VertexPoints:
    """The vertices of a mesh; each stands for a third of the faces around it."""

    owners: Owners

    @classmethod
    def of(cls, mesh: Mesh) -> Self:
        """All vertices of the mesh."""
        area = np.zeros(len(mesh.vertices))
        for rows in blocks_summed(len(mesh.faces), len(area)):
            faces = mesh.faces[rows]
            third = face_areas(Mesh(mesh.vertices, faces)) / 3
            area += np.bincount(faces.ravel(), np.repeat(third, 3), len(area))
        return cls(
            Owners(
                mesh.center,
                (mesh.vertices - mesh.center).astype(np.float32),
                vertex_normals(mesh).astype(np.float32),
                np.sqrt(area).astype(np.float32),
            )
        )

    @property
    def sizes(self) -> list[int]:
        count = len(self.owners.center)
        return [min(CHUNK, count - start) for start in range(0, count, CHUNK)]

    def rows(self, number: int) -> slice:
        """The vertices of a chunk."""
        return slice(number * CHUNK, number * CHUNK + self.sizes[number])

    def chunk(self, number: int) -> Chunk:
        rows = self.rows(number)
        return Chunk(self.owners.center[rows], np.arange(rows.start, rows.stop, dtype=np.int32))


def spread_points(points: PointSource, count: int) -> Chunk:
    """About `count` of the points, every k-th of all chunks; k is odd, so that it does not fall
    into step with rows of texels.
    """
    step = max(1, sum(points.sizes) // max(count, 1)) | 1
    parts, start = [], 0
    for number, size in enumerate(points.sizes):
        first = -start % step
        start += size
        if first < size:
            chunk = points.chunk(number)
            parts.append((chunk.xyz[first::step].copy(), chunk.owner[first::step].copy()))
    if not parts:
        return Chunk(np.zeros((0, 3), np.float32), np.zeros(0, np.int32))
    return Chunk(np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]))
