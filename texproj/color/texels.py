"""The texels of an atlas as points on the surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.color.atlas import Atlas
from texproj.color.points import Floats, SurfacePoints, facing
from texproj.color.raster import face_images
from texproj.mesh import Mesh, face_areas, vertex_normals

TILE = 256
"""Edge of the square of texels that makes one chunk: near on the page is near on the surface."""


class Tile(NamedTuple):
    """A rectangle of a page."""

    page: int
    rows: slice
    columns: slice


@dataclass(frozen=True, eq=False)
class TexelPoints:
    """The texels that a face covers.

    faces: one (h, w) int32 image per page, the face of each texel, -1 = none;
    tiles: the chunks; only tiles with texels on the surface.
    origin: (3,) float64 world; center, normal: (F, 3) float32 of the faces, relative to origin;
    edge_x, edge_y: (F, 3) float32 step on the surface per texel to the right and down;
    anchor: (F, 3) float32 where texel coordinate (0, 0) of the page would lie in the face's plane,
    moved to `corner` for precision; spacing: (F,) edge of a texel on the surface.
    """

    faces: list[NDArray[np.int32]]
    tiles: list[Tile]
    counts: list[int]
    origin: NDArray[np.float64]
    center: Floats
    normal: Floats
    spacing: Floats
    frame: Floats

    @classmethod
    def of(cls, mesh: Mesh, atlas: Atlas) -> TexelPoints:
        """All texels of the atlas."""
        images = face_images(atlas)
        tiles = [tile for page, image in enumerate(images) for tile in _tiles(page, image)]
        counts = [int((images[t.page][t.rows, t.columns] >= 0).sum()) for t in tiles]
        used = [i for i, count in enumerate(counts) if count]
        origin = mesh.center
        corners = (mesh.vertices - origin)[mesh.faces]
        normal = vertex_normals(mesh)[mesh.faces].sum(axis=1)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        uv = atlas.uv_px[atlas.faces]
        return cls(
            images,
            [tiles[i] for i in used],
            [counts[i] for i in used],
            origin,
            corners.mean(axis=1).astype(np.float32),
            (normal / np.maximum(length, 1e-30)).astype(np.float32),
            _texel_edge(mesh, uv),
            surface_frames(corners, uv),
        )

    @property
    def sizes(self) -> list[int]:
        return self.counts

    def candidates(self, camera: Camera) -> NDArray[np.bool_]:
        """Faces that face the camera."""
        return facing(self.center, self.normal, self.origin, camera) > 0

    def chunk(self, number: int, candidates: NDArray[np.bool_]) -> SurfacePoints:
        tile = self.tiles[number]
        image = self.faces[tile.page][tile.rows, tile.columns]
        flat = np.flatnonzero(image.ravel() >= 0)
        face = image.ravel()[flat]
        index = np.flatnonzero(candidates[face])
        face, flat = face[index], flat[index]
        width = image.shape[1]
        x = (flat % width).astype(np.float32) + np.float32(tile.columns.start + 0.5)
        y = (flat // width).astype(np.float32) + np.float32(tile.rows.start + 0.5)
        f = self.frame[face]
        dx, dy = x - f[:, 9], y - f[:, 10]
        xyz = f[:, 0:3] + f[:, 3:6] * dx[:, None] + f[:, 6:9] * dy[:, None]
        return SurfacePoints(index, xyz, self.origin, self.normal[face], self.spacing[face])

    def place(self, number: int, page: NDArray[np.generic], values: NDArray[np.generic]) -> None:
        """Write the values of a chunk's texels into an image of its page."""
        tile = self.tiles[number]
        on_surface = self.faces[tile.page][tile.rows, tile.columns] >= 0
        page[tile.rows, tile.columns][on_surface] = values


def surface_frames(corners: NDArray[np.float64], uv: NDArray[np.float64]) -> Floats:
    """(F, 11) float32 map from page to surface per face: a point on the surface (3), its steps per
    texel to the right (3) and down (3), and the page position of the point (2).
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    det = a * d - b * c
    det = np.where(np.abs(det) > 1e-12, det, np.inf)[:, None]
    right = (e1 * d[:, None] - e2 * b[:, None]) / det
    down = (e2 * a[:, None] - e1 * c[:, None]) / det
    return np.concatenate([corners[:, 0], right, down, uv[:, 0]], axis=1).astype(np.float32)


def _texel_edge(mesh: Mesh, uv: NDArray[np.float64]) -> Floats:
    """(F,) edge on the surface of the square that a texel stands for."""
    (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    area_px = 0.5 * np.abs(a * d - b * c)
    return np.sqrt(face_areas(mesh) / np.maximum(area_px, 1e-12)).astype(np.float32)


def _tiles(page: int, image: NDArray[np.int32]) -> list[Tile]:
    height, width = image.shape
    return [
        Tile(page, slice(y, min(y + TILE, height)), slice(x, min(x + TILE, width)))
        for y in range(0, height, TILE)
        for x in range(0, width, TILE)
    ]
