"""glTF 2.0, text and binary: triangles of the scene, placed by their nodes.

Ours, since the readers at hand decode textures that nobody asked for, take minutes for deep
trees of nodes, and throw whatever a spoiled text makes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.formats.foreign import Broken
from texproj.formats.meshes.gltf_document import (
    MOST_ELEMENTS,
    MOST_VERTICES,
    GltfDocument,
    list_of,
    object_of,
)
from texproj.formats.meshes.polygons import NO_FACES, Faces, Vertices, int32

TRIANGLES, STRIP, FAN = 4, 5, 6
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GltfPart:
    """A primitive where a node shows it. node: the node's number; primitive: its entry; world: (4,
    4) from its own frame; xyz: (n, 3) positions in it; corners: (F, 3) triangles, into xyz, as
    the file winds them; mirrored: the node turns them inside out.
    """

    node: int
    primitive: dict[str, Any]
    world: Matrix
    xyz: Vertices
    corners: NDArray[np.integer[Any]]

    @property
    def mirrored(self) -> bool:
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.linalg.det(self.world[:3, :3]) < 0)


def gltf_parts(document: GltfDocument) -> list[GltfPart]:
    """The parts of the scene in its order. Raises Broken; InputError for what is compressed and for
    buffers that cannot be read.
    """
    parts, count = [], 0
    for number, mesh, world in _placed(document):
        for entry in list_of(document.entry("meshes", mesh), "primitives"):
            primitive = object_of(entry, "primitives")
            xyz, corners = _primitive(document, primitive)
            parts.append(GltfPart(number, primitive, world, xyz, corners))
            count += len(xyz)
            if count > MOST_VERTICES:
                raise Broken(f"more than {MOST_VERTICES} vertices")
    return parts


def placed_together(parts: list[GltfPart]) -> tuple[Vertices, Faces]:
    """All triangles in one frame; points and lines only count as vertices."""
    vertices, faces, offset = [np.zeros((0, 3))], [NO_FACES], 0
    for part in parts:
        with np.errstate(over="ignore", invalid="ignore"):  # left to the repair
            xyz = part.xyz @ part.world[:3, :3].T + part.world[:3, 3]
        corners = part.corners[:, ::-1] if part.mirrored else part.corners
        vertices.append(xyz)
        faces.append(int32(corners + offset))
        offset += len(xyz)
    return np.concatenate(vertices), np.concatenate(faces)


def _placed(document: GltfDocument) -> Iterator[tuple[int, Any, Matrix]]:
    """Each mesh of the scene with its node's number and transform, parents before children."""
    waiting = [(root, np.eye(4)) for root in reversed(document.roots())]
    met: set[int] = set()
    while waiting:
        index, parent = waiting.pop()
        node = document.entry("nodes", index)
        if index in met:
            raise Broken(f"node {index} has two parents")
        met.add(index)
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = parent @ _transform(node)
        if "mesh" in node:
            yield index, node["mesh"], matrix
        waiting += [(child, matrix) for child in reversed(list_of(node, "children"))]


def _transform(node: dict[str, Any]) -> Matrix:
    if "matrix" in node:
        return _floats(node["matrix"], 16).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = _floats(node.get("rotation", (0, 0, 0, 1)), 4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= _floats(node.get("scale", (1, 1, 1)), 3)
    matrix[:3, 3] = _floats(node.get("translation", (0, 0, 0)), 3)
    return matrix


def _primitive(
    document: GltfDocument, primitive: dict[str, Any]
) -> tuple[Vertices, NDArray[np.integer[Any]]]:
    """Positions and triangles of one part, in its own frame."""
    xyz = document.attribute(primitive, "POSITION", 3).astype(np.float64)
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN):
        return xyz, NO_FACES
    listed = document.corners(primitive)
    corners = np.arange(len(xyz)) if listed is None else listed
    corners = np.where(corners < len(xyz), corners, -(MOST_ELEMENTS))  # not into the next part
    if mode == TRIANGLES:
        return xyz, corners[: len(corners) // 3 * 3].reshape(-1, 3)
    nth = np.arange(max(len(corners) - 2, 0))
    if mode == FAN:
        return xyz, np.stack([corners[0 * nth], corners[nth + 1], corners[nth + 2]], axis=1)
    odd = nth % 2
    return xyz, np.stack([corners[nth], corners[nth + 1 + odd], corners[nth + 2 - odd]], axis=1)


def _floats(values: Any, count: int) -> NDArray[np.float64]:
    try:
        array = np.array(values, np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0)
    if len(array) != count or not np.isfinite(array).all():
        raise Broken(f"a node's transform must have {count} numbers")
    return array
