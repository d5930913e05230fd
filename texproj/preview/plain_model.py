"""A glb that Draco compressed, as the page can show it, which brings no decoder."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.foreign import Broken
from texproj.formats.meshes.gltf_compressed import DRACO
from texproj.formats.meshes.gltf_document import GltfDocument, chunks_of

WIDTHS = {"VEC2": 2, "VEC3": 3, "VEC4": 4}
FLOAT, UNSIGNED = 5126, 5125


def plain_glb(path: Path) -> bytes:
    """The file with its primitives uncompressed, else as it is. Raises InputError where damaged."""
    try:
        data = path.read_bytes()
        text, binary = chunks_of(data)
        content, blob = json.loads(text), bytearray(binary)
        _unpack(GltfDocument(path, data), content, blob)
    except (Broken, OSError, ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        raise InputError(f"{path}: damaged ({error}); run `texproj color` again") from None
    for key in ("extensionsUsed", "extensionsRequired"):
        content[key] = [name for name in content.get(key, []) if name != DRACO]
        if not content[key]:
            del content[key]
    content["buffers"] = [{"byteLength": len(blob)}]
    told = json.dumps(content, separators=(",", ":")).encode()
    told += b" " * (-len(told) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(told) + len(blob))
    parts = head, struct.pack("<I4s", len(told), b"JSON"), told
    return b"".join((*parts, struct.pack("<I4s", len(blob), b"BIN\0"), blob))


def _unpack(document: GltfDocument, content: dict[str, Any], blob: bytearray) -> None:
    """Append what is compressed to the binary chunk, and let the accessors point there."""

    def put(number: int, values: NDArray[Any]) -> None:
        view = {"buffer": 0, "byteOffset": len(blob), "byteLength": values.nbytes}
        content["bufferViews"].append(view)
        blob.extend(values.tobytes())
        entry = content["accessors"][number]
        kind = FLOAT if values.dtype.kind == "f" else UNSIGNED
        entry |= {"bufferView": len(content["bufferViews"]) - 1, "componentType": kind}
        entry["count"] = len(values)
        entry.pop("byteOffset", None)

    blob.extend(bytes(-len(blob) % 4))
    for mesh in content["meshes"]:
        for primitive in mesh["primitives"]:
            told = primitive.get("extensions", {})
            if DRACO not in told:
                continue
            for name, number in primitive["attributes"].items():
                width = WIDTHS[content["accessors"][number]["type"]]
                put(number, np.asarray(document.attribute(primitive, name, width), "<f4"))
            put(primitive["indices"], np.asarray(document.corners(primitive), "<u4"))
            del told[DRACO]
