"""The mesh as renderers hold it, and the images that follow from which face each pixel sees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.mesh import Mesh, vertex_normals
from texproj.render.tessellation import Viewpoint

NEAR_OF_FAR = 1e-3
"""Nearest depth that is drawn, as a part of the farthest, where the mesh reaches behind the camera.
Otherwise the nearest vertex is the near plane, and a 24-bit depth buffer is precise."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh in scene coordinates: world minus an offset, so that float32 is fine enough.

    mesh: the mesh in world coordinates, float64.
    occlusion: (V,) float32 ambient occlusion, 0 hidden .. 1 open, or None.
    """

    mesh: Mesh
    occlusion: Floats | None = None

    def __post_init__(self) -> None:
        if not len(self.mesh.faces):
            raise ValueError("a mesh without faces cannot be rendered")
        if self.occlusion is not None and len(self.occlusion) != len(self.mesh.vertices):
            raise ValueError("ambient occlusion must have one value per vertex")

    @cached_property
    def offset(self) -> NDArray[np.float64]:
        """(3,) world position of the scene's origin: the middle of the bounding box."""
        return self.mesh.center

    @cached_property
    def xyz_in_local(self) -> Floats:
        """(V, 3) vertices minus the offset, subtracted in float64."""
        return np.ascontiguousarray(self.mesh.vertices - self.offset, np.float32)

    @cached_property
    def normal_in_world(self) -> Floats:
        """(V, 3) unit vertex normals, world axes."""
        return vertex_normals(self.mesh).astype(np.float32)

    def viewpoint(self, camera: Camera) -> Viewpoint:
        """Where the camera stands and looks, in scene coordinates."""
        near, _ = self.depth_range(camera)
        center = (camera.center - self.offset).astype(np.float32)
        return Viewpoint(center, camera.pose.R[2].astype(np.float32), near)

    def cam_from_local(self, camera: Camera) -> NDArray[np.float64]:
        """(3, 4) scene coordinates to camera axes."""
        t = camera.pose.apply(self.offset[None])[0]
        return np.concatenate([camera.pose.R, t[:, None]], axis=1)

    def rays(self, camera: Camera, ideal: Floats) -> Floats:
        """(n, 3) directions, world axes, of rays through `ideal` (n, 2); lengths count depth."""
        R = camera.pose.R.astype(np.float32)
        return ideal @ R[:2] + R[2]

    def depth_range(self, camera: Camera) -> tuple[float, float]:
        """Near and far depth between which the mesh is drawn, mesh units."""
        row = self.cam_from_local(camera)[2]
        depth = self.xyz_in_local @ row[:3].astype(np.float32)
        near, far = float(depth.min()) + row[3], float(depth.max()) + row[3]
        if far <= 0:
            return NEAR_OF_FAR, 1.0  # all behind the camera: any range shows nothing
        margin = NEAR_OF_FAR * far  # keeps a flat mesh off the planes, beyond float32 rounding
        return max(near - margin, margin), far + margin


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays meet faces: face (n,) int32, -1 = nowhere; depth (n,) float32 along the optical
    axis; u, v (n,) float32: the point is ``(1 - u - v) a + u b + v c`` of the face (a, b, c).
    """

    face: NDArray[np.int32]
    depth: Floats
    u: Floats
    v: Floats


def images_of_hits(
    surface: Surface, camera: Camera, hits: Hits, channels: tuple[str, ...]
) -> dict[str, NDArray[Any]]:
    """The images of `channels` (see GBuffer), flat (n, ...), interpolated at the hits."""
    empty = hits.face < 0
    makers: dict[str, Callable[[], NDArray[Any]]] = {
        "depth": lambda: np.where(empty, np.float32(np.inf), hits.depth),
        "face": lambda: hits.face,
        "front": lambda: ~empty & _front(surface, camera, hits.face),
        "ao": lambda: values_at_hits(surface, hits, surface.occlusion[:, None])[:, 0],  # type: ignore[index]
        "normal": lambda: _normals(surface, camera, hits),
    }
    return {name: makers[name]() for name in channels}


def values_at_hits(surface: Surface, hits: Hits, values: Floats) -> Floats:
    """(n, c) values (V, c) of the vertices interpolated at the hits; zero where nothing is hit."""
    out = np.zeros((len(hits.face), values.shape[1]), np.float32)
    seen = np.flatnonzero(hits.face >= 0)
    corners = surface.mesh.faces[hits.face[seen]]
    u, v = hits.u[seen, None], hits.v[seen, None]
    out[seen] = (1 - u - v) * values[corners[:, 0]]
    out[seen] += u * values[corners[:, 1]] + v * values[corners[:, 2]]
    return out


def _normals(surface: Surface, camera: Camera, hits: Hits) -> Floats:
    normals = values_at_hits(
        surface, hits, surface.normal_in_world @ camera.pose.R.T.astype(np.float32)
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def _front(surface: Surface, camera: Camera, face: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(n,) whether the camera's center lies on the outer side of each face."""
    a, b, c = (surface.xyz_in_local[surface.mesh.faces[:, i]].astype(np.float64) for i in range(3))
    center = camera.center - surface.offset
    outside = np.einsum("ij,ij->i", np.cross(b - a, c - a), center - a) > 0
    return outside[face]
