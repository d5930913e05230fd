"""Triangle meshes: what is given, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from texproj.layout import Layout, Node, Surface


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices and triangles in the mesh file's own frame and units.

    vertices: (V, 3) float64, finite; faces: (F, 3) int32 into vertices; layout: where the faces
    lie in textures, if the file says so.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    layout: Layout | None = None

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, np.float64).reshape(-1, 3).view()
        faces = np.ascontiguousarray(self.faces, np.int32).reshape(-1, 3).view()
        vertices.flags.writeable = faces.flags.writeable = False
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) smallest and largest coordinates of the vertices."""
        bounds = np.stack([self.vertices.min(0), self.vertices.max(0)])
        bounds.flags.writeable = False
        return bounds

    @property
    def center(self) -> NDArray[np.float64]:
        """(3,) middle of the bounding box."""
        return self.bounds.mean(0)

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, mesh units."""
        low, high = self.bounds
        return float(np.linalg.norm(high - low))


@dataclass(frozen=True, eq=False)
class MeshSource:
    """A repaired mesh and how the file's vertices map to it.

    mesh: what every method works on.
    source_vertices: (S, 3) float64, the file's vertices in the file's order, untouched.
    source_faces: (T, 3) int32 valid faces of the file in its order, into source_vertices.
    vertex_of_source: (S,) int32, the repaired vertex of each file vertex; -1 where it has none.
    repairs: what was repaired, by name, with counts; empty for a clean mesh.
    notes: what a person should know about the file, one sentence each.
    """

    mesh: Mesh
    source_vertices: NDArray[np.float64]
    source_faces: NDArray[np.int32]
    vertex_of_source: NDArray[np.int32]
    repairs: dict[str, int]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Parts:
    """Nodes and names that a model keeps of the mesh's file.

    page_names: a name for each page; nodes; node_of_face: (F,) int32 rows of nodes; uv_down: (T, 2)
    texture coordinates with v down from the top, exactly as the file has them; surfaces: what the
    material of each page says beside its colors.
    """

    page_names: tuple[str, ...]
    nodes: tuple[Node, ...]
    node_of_face: NDArray[np.int32]
    uv_down: NDArray[np.float64]
    surfaces: tuple[Surface, ...] = ()


@dataclass(frozen=True, eq=False)
class NormalMap:
    """Directions finer than a mesh's own, in the frames of its surface, as glTF has them.

    pages: (h, w, 3) uint8 beside the texture's pages; tangents: (T, 4) per texture vertex: unit
    vector to the right on the page, and 1, or -1 where the page shows the surface mirrored.
    """

    pages: tuple[NDArray[np.uint8], ...]
    tangents: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """Triangles with a texture of one or several pages, as written to files.

    vertices: (V, 3) float64; faces: (F, 3) int32 into vertices.
    uv: (T, 2) float64 on the page of the face, u right, v UP from the bottom of the page; 0..1,
    or, with `parts`, as the file has them: pages repeat beyond.
    uv_faces: (F, 3) int32 into uv, corner by corner as faces.
    page_of_face: (F,) int32 into pages, -1 = no texture.
    pages: (h, w, 3 or 4) uint8 or uint16, sRGB-encoded, row 0 on top.
    normals: (V, 3) unit vectors or None. parts: nodes and names to keep, if any;
    normal_map: if any.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    uv: NDArray[np.float64]
    uv_faces: NDArray[np.int32]
    page_of_face: NDArray[np.int32]
    pages: tuple[NDArray[np.uint8] | NDArray[np.uint16], ...]
    normals: NDArray[np.float64] | None = None
    parts: Parts | None = None
    normal_map: NormalMap | None = None


@dataclass(frozen=True, eq=False)
class ColoredMesh:
    """Triangles with a color at each vertex, as written to files.

    vertices: (V, 3) float64; faces: (F, 3) int32 into vertices.
    colors: (V, 3 or 4) uint8 or uint16, sRGB-encoded, or (V, 3) float32 linear light.
    normals: (V, 3) unit vectors or None.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    colors: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32]
    normals: NDArray[np.float64] | None = None


BLOCK = 1 << 17
"""Faces that are worked on at once where each stands for itself: some ten MB a step, whatever the
size of the mesh."""


def blocks(count: int) -> Iterator[slice]:
    """Consecutive parts of so many faces."""
    return (slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK))


def blocks_summed(count: int, vertices: int) -> Iterator[slice]:
    """Consecutive parts of so many faces, at most a few dozen: where each adds to all vertices,
    time does not grow with the square of the mesh.
    """
    size = max(BLOCK, vertices // 8)
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def by_blocks(count: int, of_block: Callable[[slice], NDArray[Any]]) -> NDArray[Any]:
    """What `of_block` gives for all faces, row by row, computed block by block."""
    if count <= BLOCK:
        return of_block(slice(0, count))
    first = of_block(slice(0, BLOCK))
    out = np.empty((count, *first.shape[1:]), first.dtype)
    out[:BLOCK] = first
    for rows in islice(blocks(count), 1, None):
        out[rows] = of_block(rows)
    return out


def face_cross(vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """(F, 3) normals times twice the area of each face, counter-clockwise outside.

    Column by column: numpy's own cross product takes three times as long.
    """
    v, f = np.asarray(vertices, np.float64), np.asarray(faces)

    def of_block(rows: slice) -> NDArray[np.float64]:
        a, b, c = (v.take(corner, axis=0) for corner in f[rows].T)
        b -= a
        c -= a
        for k in range(3):
            one, two = (k + 1) % 3, (k + 2) % 3
            np.multiply(b[:, one], c[:, two], out=a[:, k])
            a[:, k] -= b[:, two] * c[:, one]
        return a

    return by_blocks(len(f), of_block)


def norms(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) lengths of (n, k) vectors; several times faster than a norm along an axis."""
    return np.sqrt(np.einsum("ij,ij->i", vectors, vectors))


def face_normals(mesh: Mesh) -> NDArray[np.float64]:
    """(F, 3) unit normals; zero for faces without area."""
    return by_blocks(
        len(mesh.faces), lambda rows: _unit(face_cross(mesh.vertices, mesh.faces[rows]))
    )


def face_areas(mesh: Mesh) -> NDArray[np.float64]:
    """(F,) areas in squared mesh units."""
    return by_blocks(
        len(mesh.faces), lambda rows: 0.5 * norms(face_cross(mesh.vertices, mesh.faces[rows]))
    )


def vertex_normals(mesh: Mesh) -> NDArray[np.float64]:
    """(V, 3) area-weighted unit normals; zero for vertices without a face."""
    sums = np.zeros((3, len(mesh.vertices)))
    for rows in blocks_summed(len(mesh.faces), len(mesh.vertices)):
        faces = mesh.faces[rows]
        for axis, part in enumerate(face_cross(mesh.vertices, faces).T):
            sums[axis] += np.bincount(faces.ravel(), np.repeat(part, 3), sums.shape[1])
    return _unit(np.ascontiguousarray(sums.T))


def face_middles(mesh: Mesh) -> NDArray[np.float32]:
    """(F, 3) middles of the faces, relative to the mesh's center."""
    center = mesh.center

    def of_block(rows: slice) -> NDArray[np.float32]:
        a, b, c = (mesh.vertices.take(k, axis=0) - center for k in mesh.faces[rows].T)
        a += b
        a += c
        a /= 3
        return a.astype(np.float32)

    return by_blocks(len(mesh.faces), of_block)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    length = norms(vectors)[:, None]
    return vectors / np.where(length > 0, length, np.inf)
