"""The mesh as renderers hold it, and the images that follow from which face each pixel sees."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.mesh import Mesh, vertex_normals

Floats = NDArray[np.float32]

NEAR_OF_FAR = 1e-3
"""Nearest depth that is drawn, as a part of the farthest, where the mesh reaches behind the camera.
Otherwise the nearest vertex is the near plane, and a 24-bit depth buffer is precise."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh in scene coordinates: world minus an offset, so that float32 is fine enough.

    mesh: the mesh in world coordinates, float64; ao: (V,) float32 or None.
    """

    mesh: Mesh
    ao: Floats | None = None

    def __post_init__(self) -> None:
        if not len(self.mesh.faces):
            raise ValueError("a mesh without faces cannot be rendered")
        if self.ao is not None and len(self.ao) != len(self.mesh.vertices):
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
    def normals(self) -> Floats:
        """(V, 3) unit vertex normals, world axes."""
        return vertex_normals(self.mesh).astype(np.float32)

    @cached_property
    def reach(self) -> Floats:
        """(V,) length of the longest edge at each vertex."""
        longest = np.zeros(len(self.xyz_in_local), np.float32)
        for i in range(3):
            ends = self.mesh.faces[:, i], self.mesh.faces[:, i - 1]
            length = np.linalg.norm(np.subtract(*(self.xyz_in_local[e] for e in ends)), axis=1)
            for end in ends:
                np.maximum.at(longest, end, length)
        return longest

    def largest_span(self, camera: Camera) -> float:
        """Largest angle (rad, or inf) that an edge before the camera may span, seen from there."""
        center = (camera.center - self.offset).astype(np.float32)
        from_center = self.xyz_in_local - center
        before = from_center @ camera.pose.R[2].astype(np.float32) > -self.reach
        distance = np.linalg.norm(from_center, axis=1) - self.reach
        if (distance[before] <= 0).any():
            return float("inf")
        return float((self.reach[before] / distance[before]).max(initial=0))

    def cam_from_local(self, camera: Camera) -> NDArray[np.float64]:
        """(3, 4) scene coordinates to camera axes."""
        t = camera.pose.apply(self.offset[None])[0]
        return np.concatenate([camera.pose.R, t[:, None]], axis=1)

    def depth_range(self, camera: Camera) -> tuple[float, float]:
        """Near and far depth between which the mesh is drawn, mesh units."""
        row = self.cam_from_local(camera)[2]
        depth = self.xyz_in_local @ row[:3].astype(np.float32)
        span = float(depth.max() - depth.min())
        far = float(depth.max()) + row[3] + 1e-3 * span
        near = float(depth.min()) + row[3] - 1e-3 * span
        far = far if far > 0 else 1.0
        return max(near, far * NEAR_OF_FAR), far * (1 + 1e-6)


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays meet faces: face (n,) int32, -1 = nowhere; depth (n,) float32 along the optical
    axis; u, v (n,) float32: the point is ``(1 - u - v) a + u b + v c`` of the face (a, b, c).
    """

    face: NDArray[np.int32]
    depth: Floats
    u: Floats
    v: Floats


def hits_on_faces(surface: Surface, camera: Camera, ideal: Floats, face: NDArray[np.int32]) -> Hits:
    """Where the rays through `ideal` (n, 2) normalized coordinates meet the given faces.

    A ray that passes beside its face meets the nearest end of it in barycentric coordinates, so
    that nothing is extrapolated. Moeller and Trumbore 1997, in camera axes.
    """
    cam_from_local = surface.cam_from_local(camera).astype(np.float32)
    xyz_in_cam = surface.xyz_in_local @ cam_from_local[:, :3].T + cam_from_local[:, 3]
    seen = np.flatnonzero(face >= 0)
    a, b, c = (xyz_in_cam[surface.mesh.faces[face[seen], i]] for i in range(3))
    ray = np.concatenate([ideal[seen], np.ones((len(seen), 1), np.float32)], axis=1)
    p: Floats = np.cross(ray, c - a)
    q = np.cross(-a, b - a)
    det = np.einsum("ij,ij->i", b - a, p)
    det = np.where(det == 0, np.float32(np.inf), det)
    u = np.einsum("ij,ij->i", -a, p) / det
    v = np.einsum("ij,ij->i", ray, q) / det
    u, v = _inside(u, v)
    out = np.full((3, len(face)), np.inf, np.float32)
    out[:, seen] = (1 - u - v) * a[:, 2] + u * b[:, 2] + v * c[:, 2], u, v
    return Hits(face, *out)


def _inside(u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Barycentric coordinates clipped to the triangle."""
    w = np.maximum(1 - u - v, 0)
    u, v = np.maximum(u, 0), np.maximum(v, 0)
    total = u + v + w
    return u / total, v / total


def images_of_hits(
    surface: Surface, camera: Camera, hits: Hits, channels: tuple[str, ...]
) -> dict[str, NDArray[Any]]:
    """The images of `channels` (see GBuffer), flat (n, ...), interpolated at the hits."""
    empty = hits.face < 0
    makers = {
        "depth": lambda: np.where(empty, np.float32(np.inf), hits.depth),
        "face": lambda: hits.face,
        "front": lambda: ~empty & _front(surface, camera, hits.face),
        "ao": lambda: _blend(surface, hits, surface.ao[:, None])[:, 0],  # type: ignore[index]
        "normal": lambda: _normals(surface, camera, hits),
    }
    return {name: makers[name]() for name in channels}


def _blend(surface: Surface, hits: Hits, values: Floats) -> Floats:
    """(n, c) values (V, c) of the vertices interpolated at the hits; zero where nothing is hit."""
    out = np.zeros((len(hits.face), values.shape[1]), np.float32)
    seen = np.flatnonzero(hits.face >= 0)
    corners = surface.mesh.faces[hits.face[seen]]
    u, v = hits.u[seen, None], hits.v[seen, None]
    out[seen] = (1 - u - v) * values[corners[:, 0]]
    out[seen] += u * values[corners[:, 1]] + v * values[corners[:, 2]]
    return out


def _normals(surface: Surface, camera: Camera, hits: Hits) -> Floats:
    normals = _blend(surface, hits, surface.normals @ camera.pose.R.T.astype(np.float32))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def _front(surface: Surface, camera: Camera, face: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(n,) whether the camera's center lies on the outer side of each face."""
    a, b, c = (surface.xyz_in_local[surface.mesh.faces[:, i]].astype(np.float64) for i in range(3))
    center = camera.center - surface.offset
    outside = np.einsum("ij,ij->i", np.cross(b - a, c - a), center - a) > 0
    return outside[face]
