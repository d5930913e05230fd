"""glTF 2.0, text and binary: triangles of the scene, placed by their nodes.

Ours, since the readers at hand decode textures that nobody asked for, take minutes for deep
trees of nodes, and throw whatever a spoiled text makes them.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.documents import json_of, read_bytes
from texproj.formats.foreign import Broken
from texproj.formats.meshes.polygons import NO_FACES, Faces, Vertices, int32

COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
INSTANCES = "EXT_mesh_gpu_instancing"
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
TRIANGLES, STRIP, FAN = 4, 5, 6
MOST_ELEMENTS = 2**31
MOST_VERTICES = 200_000_000
"""Of all parts together, since one part may stand in many places."""
JSON_CHUNK, BINARY_CHUNK = b"JSON", b"BIN\0"
Matrix = NDArray[np.float64]


class _Document:
    """The text of a glTF and its buffers."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        text, self._binary = _chunks(data)
        content = json_of(text, f"{path}")
        if not isinstance(content, dict):
            raise Broken("an object in braces expected")
        self._content: dict[str, Any] = content
        self._buffers: dict[int, bytes] = {}
        for name in COMPRESSED:
            if name.encode() in text:
                raise InputError(f"{path}: compressed by {name}; export it uncompressed")
        if INSTANCES.encode() in text:
            told = f"its parts are instances ({INSTANCES}); export them as meshes"
            raise InputError(f"{path}: {told}")

    def entries(self, key: str) -> list[Any]:
        value = self._content.get(key, [])
        if not isinstance(value, list):
            raise Broken(f"{key} must be a list")
        return value

    def entry(self, key: str, index: Any) -> dict[str, Any]:
        entries = self.entries(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(entries):
            raise Broken(f"no {key} {index!r:.20}")
        return _object(entries[index], key)

    def roots(self) -> list[Any]:
        """The nodes on top of the scene; of a file without scenes those that nobody holds."""
        if self.entries("scenes"):
            return _list(self.entry("scenes", self._content.get("scene", 0)), "nodes")
        nodes = [_object(node, "nodes") for node in self.entries("nodes")]
        held = {c for node in nodes for c in _list(node, "children") if isinstance(c, int)}
        return [i for i in range(len(nodes)) if i not in held]

    def accessor(self, index: Any, width: int) -> NDArray[Any]:
        """(n, width) values of an accessor; integers that stand for fractions become floats."""
        entry = self.entry("accessors", index)
        count = _count(entry, "count")
        kind = entry.get("type")
        if not isinstance(kind, str) or WIDTHS.get(kind) != width:
            raise Broken(f"accessor {index} is no {width} numbers per element")
        if "bufferView" in entry:
            values = self._view(entry, count, width)
        elif "sparse" in entry and count <= MOST_VERTICES:
            values = np.zeros((count, width), _dtype(entry))
        else:
            raise Broken(f"accessor {index} has no data")
        if "sparse" in entry:
            values = self._with_sparse(entry, values)
        if entry.get("normalized") is True and values.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(values.dtype).max, -1.0)
        return values

    def _with_sparse(self, entry: dict[str, Any], values: NDArray[Any]) -> NDArray[Any]:
        sparse = _object(entry["sparse"], "sparse")
        count = _count(sparse, "count")
        rows = self._view(_object(sparse.get("indices"), "indices"), count, 1)[:, 0]
        given = _object(sparse.get("values"), "values") | {"componentType": entry["componentType"]}
        if count and rows.max() >= len(values):
            raise Broken("a sparse accessor beyond its end")
        values = values.copy()
        values[rows] = self._view(given, count, values.shape[1])
        return values

    def _view(self, entry: dict[str, Any], count: int, width: int) -> NDArray[Any]:
        """(count, width) numbers where `entry` says they are."""
        view = self.entry("bufferViews", entry.get("bufferView"))
        dtype = _dtype(entry)
        step = _count(view, "byteStride", 0) or dtype.itemsize * width
        start = _count(view, "byteOffset", 0) + _count(entry, "byteOffset", 0)
        end = start + step * (count - 1) + dtype.itemsize * width if count else start
        buffer = self._buffer(view.get("buffer"))
        if end > len(buffer):
            raise Broken("its data end early")
        strides = (step, dtype.itemsize)
        return np.ndarray((count, width), dtype, buffer, start if count else 0, strides)

    def _buffer(self, index: Any) -> bytes:
        entry = self.entry("buffers", index)
        if index not in self._buffers:
            self._buffers[index] = self._load(entry.get("uri"))
        return self._buffers[index]

    def _load(self, uri: Any) -> bytes:
        if uri is None:
            return self._binary
        if not isinstance(uri, str):
            raise Broken("the name of a buffer is no text")
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError):
                raise Broken("a buffer inside its text is damaged") from None
        name = Path(unquote(uri))
        if name.is_absolute() or ".." in name.parts or "\0" in uri:
            raise Broken("a buffer outside of its folder")
        beside = self.path.parent / name  # or, where the project links to it, beside the original
        return read_bytes(beside if beside.exists() else self.path.resolve().parent / name)


def read_gltf(path: Path, data: bytes) -> tuple[Vertices, Faces]:
    """All triangles of the scene in one frame; points and lines only count as vertices.

    Raises Broken; InputError for what is compressed and for buffers that cannot be read.
    """
    document = _Document(path, data)
    vertices, faces, offset = [np.zeros((0, 3))], [NO_FACES], 0
    for mesh, world_from_mesh in _placed(document):
        for primitive in _list(document.entry("meshes", mesh), "primitives"):
            xyz, corners = _primitive(document, _object(primitive, "primitives"))
            with np.errstate(over="ignore", invalid="ignore"):  # left to the repair
                xyz = xyz @ world_from_mesh[:3, :3].T + world_from_mesh[:3, 3]
                mirrored = np.linalg.det(world_from_mesh[:3, :3]) < 0
            vertices.append(xyz)
            faces.append(int32((corners[:, ::-1] if mirrored else corners) + offset))
            offset += len(xyz)
            if offset > MOST_VERTICES:
                raise Broken(f"more than {MOST_VERTICES} vertices")
    return np.concatenate(vertices), np.concatenate(faces)


def has_texture_coordinates(data: bytes) -> bool:
    """Whether any part has some."""
    return b'"TEXCOORD_0"' in _chunks(data)[0]


def _placed(document: _Document) -> Iterator[tuple[Any, Matrix]]:
    """Each mesh of the scene with its transform, parents before children."""
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
            yield node["mesh"], matrix
        waiting += [(child, matrix) for child in reversed(_list(node, "children"))]


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
    document: _Document, primitive: dict[str, Any]
) -> tuple[Vertices, NDArray[np.integer[Any]]]:
    """Positions and triangles of one part, in its own frame."""
    attributes = _object(primitive.get("attributes"), "attributes")
    xyz = document.accessor(attributes.get("POSITION"), 3).astype(np.float64)
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN):
        return xyz, NO_FACES
    if "indices" in primitive:
        corners = document.accessor(primitive["indices"], 1)[:, 0].astype(np.int64)
    else:
        corners = np.arange(len(xyz))
    corners = np.where(corners < len(xyz), corners, -(MOST_ELEMENTS))  # not into the next part
    if mode == TRIANGLES:
        return xyz, corners[: len(corners) // 3 * 3].reshape(-1, 3)
    nth = np.arange(max(len(corners) - 2, 0))
    if mode == FAN:
        return xyz, np.stack([corners[0 * nth], corners[nth + 1], corners[nth + 2]], axis=1)
    odd = nth % 2
    return xyz, np.stack([corners[nth], corners[nth + 1 + odd], corners[nth + 2 - odd]], axis=1)


def _chunks(data: bytes) -> tuple[bytes, bytes]:
    """The text and the binary chunk; a file that is no GLB is all text."""
    if data[:4] != b"glTF":
        return data, b""
    if len(data) < 20 or struct.unpack("<I", data[8:12])[0] > len(data):
        raise Broken("its data end early")
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        length, kind = struct.unpack("<I4s", data[at : at + 8])
        found.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    return found.get(JSON_CHUNK, b""), found.get(BINARY_CHUNK, b"")


def _object(value: Any, key: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise Broken(f"{key} must hold objects in braces")
    return value


def _list(holder: dict[str, Any], key: str) -> list[Any]:
    value = holder.get(key, [])
    if not isinstance(value, list):
        raise Broken(f"{key} must be a list")
    return value


def _count(holder: dict[str, Any], key: str, default: int | None = None) -> int:
    value = holder.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < MOST_ELEMENTS:
        raise Broken(f"{key} must be a number of bytes or elements")
    return value


def _dtype(entry: dict[str, Any]) -> np.dtype[Any]:
    kind = entry.get("componentType")
    if not isinstance(kind, int) or kind not in COMPONENTS:
        raise Broken(f"numbers of an unknown type {kind!r:.20}")
    return np.dtype(COMPONENTS[kind])


def _floats(values: Any, count: int) -> NDArray[np.float64]:
    try:
        array = np.array(values, np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0)
    if len(array) != count or not np.isfinite(array).all():
        raise Broken(f"a node's transform must have {count} numbers")
    return array
