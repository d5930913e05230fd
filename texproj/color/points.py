"""Points on the surface that want a color: vertices, or texels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.mesh import Mesh, face_areas, vertex_normals

CHUNK = 1 << 16
"""Points that are worked on at once: a few arrays of this length stay in the processor's cache,
and a chunk's samples from many photos stay in memory."""

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points with what decides how a photo sees them.

    index: (n,) their numbers in the chunk that they are part of; xyz: (n, 3) float32, relative
    to `origin`; origin: (3,) float64 world, so that coordinates of any size keep their precision;
    normal: (n, 3) float32 unit, or zero where unknown (never seen); spacing: (n,) float32 edge of
    the square that a point stands for, mesh units.
    """

    index: NDArray[np.intp]
    xyz: Floats
    origin: NDArray[np.float64]
    normal: Floats
    spacing: Floats

    def __len__(self) -> int:
        return len(self.xyz)


class PointSource(Protocol):
    """Points of a whole surface, chunk by chunk."""

    @property
    def sizes(self) -> list[int]:
        """Points of each chunk."""

    def candidates(self, camera: Camera) -> NDArray[np.bool_]:
        """What could be seen from the camera, occlusion aside; to be given to `chunk`."""

    def chunk(self, number: int, candidates: NDArray[np.bool_]) -> SurfacePoints:
        """The points of a chunk that could be seen."""


@dataclass(frozen=True, eq=False)
class VertexPoints:
    """The vertices of a mesh; each stands for a third of the faces around it."""

    origin: NDArray[np.float64]
    xyz: Floats
    normal: Floats
    spacing: Floats

    @classmethod
    def of(cls, mesh: Mesh) -> VertexPoints:
        """All vertices of the mesh."""
        origin = mesh.center
        area = np.bincount(
            mesh.faces.ravel(), np.repeat(face_areas(mesh) / 3, 3), len(mesh.vertices)
        )
        return cls(
            origin,
            (mesh.vertices - origin).astype(np.float32),
            vertex_normals(mesh).astype(np.float32),
            np.sqrt(area).astype(np.float32),
        )

    @property
    def sizes(self) -> list[int]:
        starts = range(0, len(self.xyz), CHUNK)
        return [min(CHUNK, len(self.xyz) - start) for start in starts]

    def candidates(self, camera: Camera) -> NDArray[np.bool_]:
        """Vertices that face the camera."""
        return facing(self.xyz, self.normal, self.origin, camera) > 0

    def chunk(self, number: int, candidates: NDArray[np.bool_]) -> SurfacePoints:
        start = number * CHUNK
        index = np.flatnonzero(candidates[start : start + CHUNK])
        rows = index + start
        return SurfacePoints(
            index, self.xyz[rows], self.origin, self.normal[rows], self.spacing[rows]
        )


def facing(xyz: Floats, normal: Floats, origin: NDArray[np.float64], camera: Camera) -> Floats:
    """(n,) cosine of the angle between normal and line of sight; negative on back faces."""
    to_eye = (camera.center - origin).astype(np.float32) - xyz
    along = np.einsum("ij,ij->i", to_eye, normal)
    length = np.sqrt(np.einsum("ij,ij->i", to_eye, to_eye))
    return along / np.maximum(length, np.float32(1e-30))
