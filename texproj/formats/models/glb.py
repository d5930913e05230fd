"""Binary glTF 2.0 with the texture's pages inside."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from texproj.formats.models.images import encode_pages, to_8_bit
from texproj.formats.models.precision import single_is_enough
from texproj.mesh import TexturedMesh

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
FLOAT, UNSIGNED_INT = 5126, 5125
LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071


def write_glb(
    path: Path,
    model: TexturedMesh,
    image_format: Literal["png", "jpeg"] = "png",
    unlit: bool = True,
    images: Sequence[bytes] | None = None,
) -> None:
    """Write one node with a primitive, a material and an image per page of the texture.

    Axes stay those of the mesh file. Positions are float32; where that is not enough they count
    from the middle of the model and the node is moved there. `unlit` shows the colors as they
    were photographed (KHR_materials_unlit), viewers without it light them. Images hold 8 bits;
    images: the pages where they are encoded as `image_format` already. Raises OSError.
    """
    encoded = images or encode_pages(map(to_8_bit, model.pages), image_format)
    document = _Document()
    offset = np.zeros(3)
    if not single_is_enough(model.vertices):
        offset = np.round((model.vertices.min(0) + model.vertices.max(0)) / 2)
    primitives = [
        _primitive(document, model, int(page), offset) for page in np.unique(model.page_of_face)
    ]
    node: dict[str, Any] = {"mesh": 0, "name": path.stem}
    if offset.any():
        node["translation"] = offset.tolist()
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "texproj"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"primitives": primitives}],
        "materials": [_material(i, unlit) for i in range(len(encoded))],
    }
    if (model.page_of_face < 0).any():
        content["materials"].append(_material(None, unlit))
    if encoded:
        content |= _textures([document.view(image) for image in encoded], f"image/{image_format}")
    if unlit:
        content["extensionsUsed"] = ["KHR_materials_unlit"]
    document.write(path, content)


def _textures(views: list[int], mime_type: str) -> dict[str, Any]:
    """Images, textures and the one way to sample them: linear, never across the border."""
    sampler = {
        "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR,
        "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE,
    }  # fmt: skip
    return {
        "images": [{"mimeType": mime_type, "bufferView": view} for view in views],
        "samplers": [sampler],
        "textures": [{"source": i, "sampler": 0} for i in range(len(views))],
    }


class _Document:
    """The binary chunk of a GLB while it grows, with its views and accessors."""

    def __init__(self) -> None:
        self._blobs: list[bytes] = []
        self._size = 0
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, Any]] = []

    def view(self, data: bytes, target: int | None = None) -> int:
        """Append bytes, 4-byte aligned; their view's number."""
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self._views.append(view)
        padded = data + bytes(-len(data) % 4)
        self._blobs.append(padded)
        self._size += len(padded)
        return len(self._views) - 1

    def accessor(self, values: NDArray[Any], bounds: bool = False) -> int:
        """Append (n, 2 or 3) floats or (n,) indices; their accessor's number."""
        indices = values.ndim == 1
        data = np.ascontiguousarray(values, "<u4" if indices else "<f4")
        accessor: dict[str, Any] = {
            "bufferView": self.view(
                data.tobytes(), ELEMENT_ARRAY_BUFFER if indices else ARRAY_BUFFER
            ),
            "componentType": UNSIGNED_INT if indices else FLOAT,
            "count": len(data),
            "type": "SCALAR" if indices else f"VEC{data.shape[1]}",
        }
        if bounds:
            accessor |= {"min": data.min(0).tolist(), "max": data.max(0).tolist()}
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def write(self, path: Path, content: dict[str, Any]) -> None:
        content = content | {
            "bufferViews": self._views,
            "accessors": self._accessors,
            "buffers": [{"byteLength": self._size}],
        }
        text = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._size
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, total))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            file.write(struct.pack("<I4s", self._size, b"BIN\0"))
            file.writelines(self._blobs)


def _primitive(
    document: _Document, model: TexturedMesh, page: int, offset: NDArray[np.float64]
) -> dict[str, Any]:
    """The faces of one page, one glTF vertex per pair of vertex and texture vertex."""
    rows = model.page_of_face == page
    vertex = model.faces[rows].ravel().astype(np.int64)
    texel = model.uv_faces[rows].ravel().astype(np.int64) if page >= 0 else np.zeros_like(vertex)
    pairs, indices = np.unique(vertex * (len(model.uv) + 1) + texel, return_inverse=True)
    vertex, texel = pairs // (len(model.uv) + 1), pairs % (len(model.uv) + 1)
    attributes = {"POSITION": document.accessor(model.vertices[vertex] - offset, bounds=True)}
    if model.normals is not None:
        attributes["NORMAL"] = document.accessor(model.normals[vertex])
    if page >= 0:
        uv_down = model.uv[texel] * (1, -1) + (0, 1)
        attributes["TEXCOORD_0"] = document.accessor(uv_down)
    material = page if page >= 0 else len(model.pages)
    return {
        "attributes": attributes,
        "indices": document.accessor(indices.ravel()),
        "material": material,
    }


def _material(page: int | None, unlit: bool) -> dict[str, Any]:
    surface: dict[str, Any] = {"metallicFactor": 0, "roughnessFactor": 1}
    if page is None:
        surface["baseColorFactor"] = [0.2, 0.2, 0.2, 1]
    else:
        surface["baseColorTexture"] = {"index": page}
    material: dict[str, Any] = {
        "name": "untextured" if page is None else f"page_{page}",
        "pbrMetallicRoughness": surface,
        "doubleSided": True,
    }
    if unlit:
        material["extensions"] = {"KHR_materials_unlit": {}}
    return material
