"""The texels of an atlas as points on the surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.points.source import Chunk, Owners
from texproj.mesh import Mesh, blocks, by_blocks, face_areas, vertex_normals
from texproj.resources.scratch import Scratch
from texproj.resources.threads import in_parallel
from texproj.unwrap.atlas import Atlas
from texproj.unwrap.texel_faces import face_image

TILE = 256
"""Edge of the square of texels that makes one chunk: near on the page is near on the surface."""

GUTTER = 2
"""Texels that faces may grow beyond their charts: what bilinear filters and the first mipmaps read;
at most half of the padding."""


MOST_FRAMES = 1 << 20
"""Faces of which all maps from page to surface are kept, 44 bytes each; of more, those of one row
of tiles after the other."""


class Tile(NamedTuple):
    """A square of a page that holds texels of the surface.

    texels: how many on the surface; start: where their data lie in the scratch file.
    """

    page: int
    rows: slice
    columns: slice
    texels: int
    start: int


@dataclass(frozen=True, eq=False)
class TexelPoints:
    """The texels whose centers a face covers, tile by tile, on disk: 16 bytes and a bit each."""

    owners: Owners
    tiles: list[Tile]
    scratch: Scratch

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        atlas: Atlas,
        scratch: Scratch,
        growing: NDArray[np.bool_] | None = None,
    ) -> TexelPoints:
        """All texels of the atlas, written to `scratch`.

        growing: (F,) faces whose planes go on for `GUTTER` texels outside of their charts, if any.
        """
        owners = Owners.of_faces(mesh, _texel_edge(mesh, atlas), _smooth_normals(mesh))
        every = np.arange(len(mesh.faces)) if len(mesh.faces) <= MOST_FRAMES else None
        frames = None if every is None else _Frames.of(mesh, atlas, every)
        tiles = []
        for page in range(len(atlas.page_sizes)):
            tiles += _write_page(mesh, atlas, page, frames, scratch, growing)
        return cls(owners, tiles, scratch)

    @property
    def sizes(self) -> list[int]:
        return [tile.texels for tile in self.tiles]

    def chunk(self, number: int) -> Chunk:
        tile = self.tiles[number]
        start = tile.start + _mask_bytes(tile)
        data = self.scratch.read(start, 16 * tile.texels)
        owner = np.frombuffer(data, np.int32, tile.texels)
        xyz = np.frombuffer(data, np.float32, 3 * tile.texels, 4 * tile.texels)
        return Chunk(xyz.reshape(-1, 3), owner)

    def place(self, number: int, page: NDArray[np.generic], values: NDArray[np.generic]) -> None:
        """Write the values of a chunk's texels into an image of its page."""
        tile, mask = self.tiles[number], self.mask(number)
        part = page[tile.rows, tile.columns]
        if values.ndim == 1:
            part[mask] = values
            return
        rank = np.maximum(np.cumsum(mask.ravel(), dtype=np.int32) - 1, 0)
        spread = values.take(rank, axis=0).reshape(part.shape)
        cv2.copyTo(spread, mask.view(np.uint8), part)  # a quarter of what an indexed write takes

    def mask(self, number: int) -> NDArray[np.bool_]:
        """Image of a tile: which of its texels lie on the surface, in the order of the chunk."""
        tile = self.tiles[number]
        shape = (tile.rows.stop - tile.rows.start, tile.columns.stop - tile.columns.start)
        bits = np.frombuffer(self.scratch.read(tile.start, _mask_bytes(tile)), np.uint8)
        return np.unpackbits(bits, count=shape[0] * shape[1]).reshape(shape).view(bool)

    def inside(self, page: int, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """(h, w) which texels of a page lie on the surface."""
        out = np.zeros(shape[:2], bool)
        for number, tile in enumerate(self.tiles):
            if tile.page == page:
                out[tile.rows, tile.columns] = self.mask(number)
        return out

    def owners_at(self, number: int, chosen: NDArray[np.bool_]) -> NDArray[np.int32]:
        """The faces of chosen texels (an image of the tile, only texels on the surface)."""
        return self.chunk(number).owner[chosen[self.mask(number)]]


def _mask_bytes(tile: Tile) -> int:
    texels = (tile.rows.stop - tile.rows.start) * (tile.columns.stop - tile.columns.start)
    return -(-texels // 8)


def _write_page(
    mesh: Mesh,
    atlas: Atlas,
    page: int,
    frames: _Frames | None,
    scratch: Scratch,
    growing: NDArray[np.bool_] | None,
) -> list[Tile]:
    """The tiles of a page; each: which texels, then their faces, then their positions. frames: of
    all faces, if they are few.
    """
    faces = face_image(atlas, page)
    height, width = faces.shape
    tiles: list[Tile | None] = []
    for y in range(0, height, TILE):
        rows = slice(y, min(y + TILE, height))
        columns = [slice(x, min(x + TILE, width)) for x in range(0, width, TILE)]
        parts = [
            faces[rows, some] if growing is None else _grown(faces, rows, some, growing)
            for some in columns
        ]
        own = frames or _Frames.of(mesh, atlas, _present(parts, len(mesh.faces)))
        places = [(page, rows, some) for some in columns]
        tiles += _write_tiles(places, parts, own, scratch)
    return [tile for tile in tiles if tile is not None]


def _write_tiles(
    places: list[tuple[int, slice, slice]],
    parts: list[NDArray[np.int32]],
    frames: _Frames,
    scratch: Scratch,
) -> list[Tile | None]:
    """Tiles of one row of them; None where there is no surface."""
    tiles: list[Tile | None] = [None] * len(places)

    def one(number: int) -> None:
        part, (page, rows, columns) = parts[number], places[number]
        mask = part >= 0
        inside = np.flatnonzero(mask)
        if len(inside):
            owner = part.ravel().take(inside)
            row, column = np.divmod(inside.astype(np.int32), np.int32(part.shape[1]))
            x, y = column + np.float32(columns.start + 0.5), row + np.float32(rows.start + 0.5)
            xyz = on_surface(frames.rows, frames.number.take(owner), x, y)
            kept = np.packbits(mask).tobytes(), owner.data.cast("B"), xyz.data.cast("B")
            tiles[number] = Tile(page, rows, columns, len(inside), scratch.append(*kept))

    in_parallel(one, range(len(places)))
    return tiles


@dataclass(frozen=True, eq=False)
class _Frames:
    """`surface_frames` of some faces: rows (11, n), and number: (F,) the column of each of them."""

    rows: Floats
    number: NDArray[np.int32]

    @classmethod
    def of(cls, mesh: Mesh, atlas: Atlas, faces: NDArray[np.intp]) -> _Frames:
        number = np.empty(len(mesh.faces), np.int32)
        number[faces] = np.arange(len(faces), dtype=np.int32)
        center, frames = mesh.center, np.empty((11, len(faces)), np.float32)
        for some in blocks(len(faces)):
            own = faces[some]
            corners = mesh.vertices[mesh.faces[own]] - center
            frames[:, some] = surface_frames(corners, atlas.uv_px[atlas.faces[own]])
        return cls(frames, number)


def _present(parts: list[NDArray[np.int32]], count: int) -> NDArray[np.intp]:
    """The faces in images of faces, of so many in all; -1 is none."""
    there = np.zeros(count + 1, bool)
    for part in parts:
        there[part] = True
    return np.flatnonzero(there[:-1])


def _grown(
    faces: NDArray[np.int32], rows: slice, columns: slice, growing: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Part of an image of faces in which growing ones have spread into empty texels."""
    top, left = max(rows.start - GUTTER, 0), max(columns.start - GUTTER, 0)
    part = faces[top : rows.stop + GUTTER, left : columns.stop + GUTTER]
    for _ in range(GUTTER):
        source = np.where(growing[part], part, -1).astype(np.float32)  # exact up to 16 M faces
        spread = cv2.dilate(source, np.ones((3, 3), np.uint8)).astype(np.int32)
        part = np.where(part < 0, spread, part)
    part = part[rows.start - top :, columns.start - left :]
    return part[: rows.stop - rows.start, : columns.stop - columns.start].copy()


def on_surface(frames: Floats, owner: NDArray[np.int32], x: Floats, y: Floats) -> Floats:
    """(n, 3) points of page positions (x, y), each in the plane of the frame of its owner."""
    dx = x - frames[9].take(owner)
    dy = y - frames[10].take(owner)
    columns = []
    for axis in range(3):
        along = frames[3 + axis].take(owner)
        along *= dx
        down = frames[6 + axis].take(owner)
        down *= dy
        along += down
        along += frames[axis].take(owner)
        columns.append(along)
    return cv2.merge(columns).reshape(-1, 3)


def _smooth_normals(mesh: Mesh) -> Floats:
    """(F, 3) unit normals of the faces, those of their vertices averaged."""
    at_vertices = vertex_normals(mesh)

    def of_block(rows: slice) -> Floats:
        normal = at_vertices[mesh.faces[rows]].sum(axis=1)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        return normal.astype(np.float32)

    return by_blocks(len(mesh.faces), of_block)


def surface_frames(corners: NDArray[np.float64], uv: NDArray[np.float64]) -> Floats:
    """(11, F) float32 map from page to surface per face: a point on the surface (3), its steps per
    texel to the right (3) and down (3), and the page position of the point (2).
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    det = a * d - b * c
    det = np.where(np.abs(det) > 1e-12, det, np.inf)[:, None]
    right = (e1 * d[:, None] - e2 * b[:, None]) / det
    down = (e2 * a[:, None] - e1 * c[:, None]) / det
    rows = np.concatenate([corners[:, 0], right, down, uv[:, 0]], axis=1)
    return np.ascontiguousarray(rows.T, np.float32)


def _texel_edge(mesh: Mesh, atlas: Atlas) -> Floats:
    """(F,) edge on the surface of the square that a texel stands for."""

    def of_block(rows: slice) -> Floats:
        uv = atlas.uv_px[atlas.faces[rows]]
        (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
        area_px = 0.5 * np.abs(a * d - b * c)
        area = face_areas(Mesh(mesh.vertices, mesh.faces[rows]))
        return np.sqrt(area / np.maximum(area_px, 1e-12)).astype(np.float32)

    return by_blocks(len(mesh.faces), of_block)
