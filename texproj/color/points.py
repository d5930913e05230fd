"""Points on the surface that want a color: vertices, or texels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.mesh import Mesh, face_areas, vertex_normals

CHUNK = 1 << 16
"""Points that are worked on at once: a few arrays of this length stay in the processor's cache,
and a chunk's samples from many photos stay in memory."""

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points with what decides how a photo sees them.

    xyz: (n, 3) float32, relative to `origin`; origin: (3,) float64 world, so that coordinates of
    any size keep their precision; normal: (n, 3) float32 unit, or zero where unknown (never
    seen); spacing: (n,) float32 or (1,) edge of the square that a point stands for, mesh units.
    """

    xyz: Floats
    origin: NDArray[np.float64]
    normal: Floats
    spacing: Floats

    def __len__(self) -> int:
        return len(self.xyz)

    def at(self, where: slice | NDArray[np.integer]) -> SurfacePoints:
        """The chosen points alone."""
        spacing = self.spacing if len(self.spacing) == 1 else self.spacing[where]
        return SurfacePoints(self.xyz[where], self.origin, self.normal[where], spacing)


def chunks(count: int, size: int = CHUNK) -> Iterator[slice]:
    """Slices of at most `size` that cover `range(count)`."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def vertex_points(mesh: Mesh) -> SurfacePoints:
    """The vertices; each stands for a third of the faces around it."""
    origin = mesh.center
    area = np.repeat(face_areas(mesh) / 3, 3)
    area = np.bincount(mesh.faces.ravel(), area, len(mesh.vertices))
    return SurfacePoints(
        (mesh.vertices - origin).astype(np.float32),
        origin,
        vertex_normals(mesh).astype(np.float32),
        np.sqrt(area).astype(np.float32),
    )
