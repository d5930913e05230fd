"""The container of a binary glTF 2.0: one JSON text and one binary chunk."""

from __future__ import annotations

import errno
import json
import shutil
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.documents import json_of

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
COMPONENTS = {"f4": 5126, "u4": 5125}

MOST_BYTES = 2**32 - 1
"""Lengths in a GLB are 32-bit numbers."""

Box = tuple[NDArray[np.float64], float]
"""Lowest corner (3,) of a model and its longest side, in the frame of its positions."""

Blob = NDArray[Any] | Path
"""Bytes of the binary chunk: an array, or a file that is copied into it."""


class Document:
    """The binary chunk of a GLB while it grows, with its views and accessors."""

    extension: str = ""
    """Without which a viewer does not understand the primitives; empty where there is none."""

    def __init__(self) -> None:
        self._blobs: list[Blob] = []
        self._size = 0
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, Any]] = []

    def view(self, blob: Blob, target: int | None = None) -> int:
        """Append bytes, 4-byte aligned; their view's number."""
        length = _length(blob)
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": length}
        if target is not None:
            view["target"] = target
        self._views.append(view)
        self._blobs.append(blob)
        self._size += length + -length % 4
        return len(self._views) - 1

    def primitive(
        self, attributes: Mapping[str, NDArray[Any]], corners: NDArray[Any], box: Box
    ) -> dict[str, Any]:
        """Append a primitive: (n, 2 to 4) values per vertex by the standard's names, and (3 F,)
        corners. box: of the whole model; here nothing follows from it.
        """
        del box
        return {
            "attributes": {
                name: self.vectors(values, bounds=name == "POSITION")
                for name, values in attributes.items()
            },
            "indices": self.indices(corners),
        }

    def promised(self, values: NDArray[Any], bounds: bool = False) -> int:
        """An accessor of (n, 1 to 4) values that stand elsewhere, compressed; its number."""
        width = values.shape[1]
        accessor = {
            "componentType": COMPONENTS[values.dtype.str[1:]],
            "count": len(values),
            "type": "SCALAR" if width == 1 else f"VEC{width}",
        }
        if bounds:
            accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def indices(self, values: NDArray[Any]) -> int:
        """Append (n,) indices; their accessor's number."""
        return self._accessor(np.ascontiguousarray(values, "<u4"), "SCALAR", ELEMENT_ARRAY_BUFFER)

    def vectors(self, values: NDArray[Any], bounds: bool = False) -> int:
        """Append (n, 2 to 4) values per vertex as float32; their accessor's number."""
        data = np.ascontiguousarray(values, "<f4")
        number = self._accessor(data, f"VEC{data.shape[1]}", ARRAY_BUFFER)
        if bounds:
            low, high = data.min(0).tolist(), data.max(0).tolist()
            self._accessors[number] |= {"min": low, "max": high}
        return number

    def _accessor(self, data: NDArray[Any], kind: str, target: int) -> int:
        accessor = {
            "bufferView": self.view(data, target),
            "componentType": COMPONENTS[data.dtype.str[1:]],
            "count": len(data),
            "type": kind,
        }
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def write(self, path: Path, content: dict[str, Any]) -> None:
        """Write the file: `content` with what has been appended. Raises OSError, also for more
        than the 4 GB that the format can hold.
        """
        content = content | {
            "bufferViews": self._views,
            "accessors": self._accessors,
            "buffers": [{"byteLength": self._size}],
        }
        text = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._size
        if total > MOST_BYTES:
            raise OSError(errno.EFBIG, "a glb holds at most 4 GB; write an obj or fewer pages")
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, total))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            file.write(struct.pack("<I4s", self._size, b"BIN\0"))
            for blob in self._blobs:
                _write(blob, file)


def required_extensions(path: Path) -> tuple[str, ...]:
    """What a viewer must know to show a GLB; nothing for a file that is none. Raises OSError."""
    with path.open("rb") as file:
        head = file.read(20)
        if len(head) < 20 or head[:4] != b"glTF":
            return ()
        text = file.read(min(struct.unpack("<I", head[12:16])[0], path.stat().st_size))
    try:
        content = json_of(text, f"{path}")
    except InputError:
        return ()
    names = content.get("extensionsRequired") if isinstance(content, dict) else None
    return tuple(name for name in names if isinstance(name, str)) if isinstance(names, list) else ()


def _length(blob: Blob) -> int:
    return blob.stat().st_size if isinstance(blob, Path) else blob.nbytes


def _write(blob: Blob, out: BinaryIO) -> None:
    if isinstance(blob, Path):
        with blob.open("rb") as file:
            shutil.copyfileobj(file, out, 1 << 20)
    else:
        out.write(blob.data)
    out.write(bytes(-_length(blob) % 4))
