"""What of a glTF is compressed: primitives by Draco, buffer views by meshopt.

KHR_draco_mesh_compression and EXT_meshopt_compression of the Khronos registry of extensions; Draco
by Google's own library (DracoPy), meshopt by meshoptimizer's own (meshopt, an extra).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.foreign import Broken, foreign_parser

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
MOST_BYTES = 1 << 32
"""Of a view once it is decoded: what a glb could hold without."""

MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")

SEQUENTIAL, EDGEBREAKER = 0, 1
HEAD = 11
"""Bytes of a Draco file before its connectivity: mark, version, kind, method, flags."""
VERSION = (2, 2)
"""From which on the counts are written as here; glTF demands it."""
METADATA = 0x80
"""In the second byte of the flags: names come before the connectivity."""


@dataclass(frozen=True, eq=False)
class DracoPart:
    """A primitive out of a Draco file. attributes: (n, k) values by their number in it; corners:
    (F, 3) int64.
    """

    attributes: dict[int, NDArray[Any]]
    corners: NDArray[np.int64]


def draco_part(data: bytes, vertices: int, indices: int) -> DracoPart:
    """Decode a Draco file. vertices, indices: how many the glTF says it has.

    The counts are compared first, because on spoiled ones the decoder runs for minutes. Raises
    Broken.
    """
    import DracoPy  # noqa: PLC0415 - only where a file is compressed

    told = _counts(data)
    if told is not None and (told[0] > max(vertices, indices) or 3 * told[1] > indices):
        raise Broken("its compressed part has other counts than its text says")
    with foreign_parser():
        mesh = DracoPy.decode(data)
        corners = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
        attributes = {int(a["unique_id"]): np.asarray(a["data"]) for a in mesh.attributes}
    return DracoPart(attributes, corners)


def _counts(data: bytes) -> tuple[int, int] | None:
    """Vertices and faces by the head of a Draco file; None where it does not say so at once."""
    if len(data) < HEAD + 2 or data[:5] != b"DRACO" or data[HEAD - 1] & METADATA:
        return None
    if tuple(data[5:7]) < VERSION:
        return None
    at = HEAD + (data[8] == EDGEBREAKER)  # after the kind of traversal
    first, at = _varint(data, at)
    second, _ = _varint(data, at)
    return (second, first) if data[8] == SEQUENTIAL else (first, second)


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, the lowest first, and where the next one begins."""
    value = 0
    for shift in range(0, 35, 7):
        if at >= len(data):
            raise Broken("its compressed part ends early")
        value |= (data[at] & 0x7F) << shift
        at += 1
        if data[at - 1] < 0x80:
            break
    return value, at


def meshopt_of(view: dict[str, Any]) -> dict[str, Any] | None:
    """What a buffer view says of its compression; None if it has none."""
    extensions = view.get("extensions")
    if not isinstance(extensions, dict):
        return None
    found = [extensions[name] for name in MESHOPT if isinstance(extensions.get(name), dict)]
    return found[0] if found else None


def meshopt_bytes(data: bytes, count: int, stride: int, told: dict[str, Any]) -> bytes:
    """A compressed view's plain bytes: `count` rows of `stride` bytes.

    Raises Broken; InputError where the package is not installed.
    """
    try:
        import meshopt  # noqa: PLC0415 - an extra
    except ImportError:
        raise InputError(
            "it is compressed by meshopt; pip install meshopt, or export it uncompressed"
        ) from None
    mode, kind = told.get("mode"), told.get("filter", FILTERS[0])
    if mode not in MODES or kind not in FILTERS or not 0 < count * stride <= MOST_BYTES:
        raise Broken("its compression is of an unknown kind")
    with foreign_parser():
        rows = meshopt.decode_gltf_buffer(data, count, stride, mode, kind)
        return rows.tobytes()
