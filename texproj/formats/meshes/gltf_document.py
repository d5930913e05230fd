"""The text of a glTF and its buffers: entries, accessors, images."""

from __future__ import annotations

import base64
import binascii
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.documents import json_of, read_bytes
from texproj.formats.foreign import Broken
from texproj.formats.meshes.gltf_compressed import (
    DRACO,
    DracoPart,
    draco_part,
    meshopt_bytes,
    meshopt_of,
)

INSTANCES = "EXT_mesh_gpu_instancing"
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
MOST_ELEMENTS = 2**31
MOST_VERTICES = 200_000_000
"""Of all parts together, since one part may stand in many places."""
JSON_CHUNK, BINARY_CHUNK = b"JSON", b"BIN\0"


class GltfDocument:
    """The text of a glTF and its buffers."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        text, self._binary = chunks_of(data)
        content = json_of(text, f"{path}")
        if not isinstance(content, dict):
            raise Broken("an object in braces expected")
        self._content: dict[str, Any] = content
        self._buffers: dict[int, bytes] = {}
        self._plain_views: dict[int, bytes] = {}
        self._draco: dict[int, DracoPart] = {}
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
        return object_of(entries[index], key)

    def roots(self) -> list[Any]:
        """The nodes on top of the scene; of a file without scenes those that nobody holds."""
        if self.entries("scenes"):
            return list_of(self.entry("scenes", self._content.get("scene", 0)), "nodes")
        nodes = [object_of(node, "nodes") for node in self.entries("nodes")]
        held = {c for node in nodes for c in list_of(node, "children") if isinstance(c, int)}
        return [i for i in range(len(nodes)) if i not in held]

    def attribute(self, primitive: dict[str, Any], name: str, width: int) -> NDArray[Any]:
        """(n, width) values of a primitive's vertices, whether it is compressed or not."""
        attributes = object_of(primitive.get("attributes"), "attributes")
        told = _draco_of(primitive)
        number = object_of(told.get("attributes", {}), DRACO).get(name)
        if not isinstance(number, int):
            return self.accessor(attributes.get(name), width)
        entry = self.entry("accessors", attributes.get(name))
        values = self._draco_part(primitive, told).attributes.get(number)
        if values is None or values.ndim != 2 or values.shape[1] != width:
            raise Broken(f"its compressed part has no {name}")
        return _fractions(entry, values)

    def corners(self, primitive: dict[str, Any]) -> NDArray[np.int64] | None:
        """(n,) rows of a primitive's vertices in their order; None where it lists none."""
        told = _draco_of(primitive)
        if told:
            return self._draco_part(primitive, told).corners.ravel()
        if "indices" not in primitive:
            return None
        return self.accessor(primitive["indices"], 1)[:, 0].astype(np.int64)

    def _draco_part(self, primitive: dict[str, Any], told: dict[str, Any]) -> DracoPart:
        view = told.get("bufferView")
        if not isinstance(view, int):
            raise Broken(f"{DRACO} names no data")
        if view not in self._draco:
            attributes = object_of(primitive.get("attributes"), "attributes")
            counted = attributes.get("POSITION"), primitive.get("indices")
            vertices, indices = (_count(self.entry("accessors", n), "count") for n in counted)
            self._draco[view] = draco_part(self.view_bytes(view), vertices, indices)
        return self._draco[view]

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
        return _fractions(entry, values)

    def _with_sparse(self, entry: dict[str, Any], values: NDArray[Any]) -> NDArray[Any]:
        sparse = object_of(entry["sparse"], "sparse")
        count = _count(sparse, "count")
        rows = self._view(object_of(sparse.get("indices"), "indices"), count, 1)[:, 0]
        given = object_of(sparse.get("values"), "values") | {
            "componentType": entry["componentType"]
        }
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
        told = meshopt_of(view)
        start = _count(entry, "byteOffset", 0)
        if told is None:
            start += _count(view, "byteOffset", 0)
            buffer = self._buffer(view.get("buffer"))
        else:
            buffer = self._plain(entry["bufferView"], told)
            step = _count(told, "byteStride")
        end = start + step * (count - 1) + dtype.itemsize * width if count else start
        if end > len(buffer):
            raise Broken("its data end early")
        strides = (step, dtype.itemsize)
        return np.ndarray((count, width), dtype, buffer, start if count else 0, strides)

    def _plain(self, index: int, told: dict[str, Any]) -> bytes:
        """What a view holds that is compressed by meshopt."""
        if index not in self._plain_views:
            start, length = _count(told, "byteOffset", 0), _count(told, "byteLength")
            data = self._buffer(told.get("buffer"))[start : start + length]
            shape = _count(told, "count"), _count(told, "byteStride")
            try:
                self._plain_views[index] = meshopt_bytes(data, *shape, told)
            except InputError as error:
                raise InputError(f"{self.path}: {error}") from None
        return self._plain_views[index]

    def _buffer(self, index: Any) -> bytes:
        entry = self.entry("buffers", index)
        if index not in self._buffers:
            self._buffers[index] = self._load(entry.get("uri"))
        return self._buffers[index]

    def view_bytes(self, index: Any) -> bytes:
        """The bytes of a buffer view."""
        view = self.entry("bufferViews", index)
        start, length = _count(view, "byteOffset", 0), _count(view, "byteLength")
        return self._buffer(view.get("buffer"))[start : start + length]

    def beside(self, uri: str) -> Path:
        """The file that a reference names, or, where the project links to the glTF, the one beside
        the original.
        """
        name = Path(unquote(uri))
        if name.is_absolute() or ".." in name.parts or "\0" in uri:
            raise Broken("a buffer outside of its folder")
        here = self.path.parent / name
        return here if here.exists() else self.path.resolve().parent / name

    def _load(self, uri: Any) -> bytes:
        if uri is None:
            return self._binary
        if not isinstance(uri, str):
            raise Broken("the name of a buffer is no text")
        if uri.startswith("data:"):
            return inline_bytes(uri)
        return read_bytes(self.beside(uri))


def inline_bytes(uri: str) -> bytes:
    """What a reference of kind data: holds. Raises Broken."""
    try:
        return base64.b64decode(uri.partition(",")[2], validate=True)
    except (binascii.Error, ValueError):
        raise Broken("a buffer inside its text is damaged") from None


def chunks_of(data: bytes) -> tuple[bytes, bytes]:
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


def object_of(value: Any, key: str) -> dict[str, Any]:
    """A value that must be an object. Raises Broken."""
    if not isinstance(value, dict):
        raise Broken(f"{key} must hold objects in braces")
    return value


def list_of(holder: dict[str, Any], key: str) -> list[Any]:
    """The list under a key, empty where there is none. Raises Broken."""
    value = holder.get(key, [])
    if not isinstance(value, list):
        raise Broken(f"{key} must be a list")
    return value


def _count(holder: dict[str, Any], key: str, default: int | None = None) -> int:
    value = holder.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < MOST_ELEMENTS:
        raise Broken(f"{key} must be a number of bytes or elements")
    return value


def _draco_of(primitive: dict[str, Any]) -> dict[str, Any]:
    """What a primitive says of its compression by Draco; empty if it has none."""
    extensions = object_of(primitive.get("extensions", {}), "extensions")
    return object_of(extensions.get(DRACO, {}), DRACO)


def _fractions(entry: dict[str, Any], values: NDArray[Any]) -> NDArray[Any]:
    """Values of an accessor; integers that stand for fractions become floats."""
    if entry.get("normalized") is True and values.dtype.kind in "iu":
        return np.asarray(np.maximum(values / np.iinfo(values.dtype).max, -1.0))
    return values


def _dtype(entry: dict[str, Any]) -> np.dtype[Any]:
    kind = entry.get("componentType")
    if not isinstance(kind, int) or kind not in COMPONENTS:
        raise Broken(f"numbers of an unknown type {kind!r:.20}")
    return np.dtype(COMPONENTS[kind])
