"""The points of the surface that the pixels of pictures show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.points.source import Chunk, Owners
from texproj.mesh import Mesh
from texproj.render import Scene


@dataclass(frozen=True, eq=False)
class PixelPoints:
    """One chunk per picture: the pixels in which the mesh is, row by row; owners are the faces, as
    those of texels are.

    masks: per picture (h, w) bool, which of its pixels show the mesh.
    """

    owners: Owners
    chunks: tuple[Chunk, ...]
    masks: tuple[NDArray[np.bool_], ...]

    @classmethod
    def of(
        cls, mesh: Mesh, scene: Scene, cameras: Sequence[Camera], spacing: NDArray[np.float64]
    ) -> PixelPoints:
        """What the cameras see. spacing: (F,) edge of the square that a colored point stands for,
        mesh units.
        """
        chunks, masks = zip(*(_shown(camera, scene, mesh) for camera in cameras), strict=True)
        return cls(Owners.of_faces(mesh, spacing), chunks, masks)

    @property
    def sizes(self) -> list[int]:
        return [len(chunk) for chunk in self.chunks]

    def chunk(self, number: int) -> Chunk:
        return self.chunks[number]

    def image(self, number: int, values: Floats) -> Floats:
        """(h, w) float32 values of a chunk as a picture, nan where the mesh is not."""
        out = np.full(self.masks[number].shape, np.nan, np.float32)
        out[self.masks[number]] = values
        return out


def _shown(camera: Camera, scene: Scene, mesh: Mesh) -> tuple[Chunk, NDArray[np.bool_]]:
    seen = scene.gbuffer(camera, ("depth", "face"))
    face = seen.require("face")
    mask = face >= 0
    xyz = seen.points(camera, *np.nonzero(mask))
    return Chunk((xyz - mesh.center).astype(np.float32), face[mask]), mask
