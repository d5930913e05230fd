"""Binary glTF 2.0: a mesh with the texture's pages inside, or with vertex colors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from texproj.formats.models.binary import Document
from texproj.formats.models.precision import single_is_enough
from texproj.mesh import ColoredMesh, TexturedMesh
from texproj.photo import linear_from_srgb
from texproj.provenance import GENERATOR, NOTHING, Provenance
from texproj.standing import Standing

GlbImage = Literal["png", "jpeg", "webp", "ktx2"]
"""What viewers read: png and jpeg by the standard itself, the others by an extension."""

IMAGE_EXTENSIONS = {"webp": "EXT_texture_webp", "ktx2": "KHR_texture_basisu"}
UNLIT = "KHR_materials_unlit"
UPRIGHT = "upright"
"""Name of the node above all others that turns and scales the scan, where it does not stand as glTF
has it: below it everything is in the scan's frame."""

LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071


def write_glb(
    path: Path,
    model: TexturedMesh,
    images: Sequence[Path],
    image_format: GlbImage = "png",
    unlit: bool = True,
    standing: Standing | None = None,
    provenance: Provenance = NOTHING,
) -> None:
    """Write one node with a primitive, a material and an image per page of the texture.

    Positions stay those of the mesh file; a node above (`UPRIGHT`) makes it stand as `standing`
    says. They are float32; where that is not enough they count
    from the middle of the model and the node is moved there. `unlit` shows the colors as they
    were photographed (KHR_materials_unlit), viewers without it light them. images: the files of
    the pages, 8 bits as the standard has it for colors; webp and ktx2 are marked as required,
    there is no second copy for viewers without them. `provenance` stands in the asset: copyright,
    and its facts under extras.texproj. Raises OSError.
    """
    document = Document()
    offset = offset_of(model.vertices)
    primitives = [
        page_primitive(document, model, int(page), offset) for page in np.unique(model.page_of_face)
    ]
    materials = [_material(i, unlit) for i in range(len(images))]
    if (model.page_of_face < 0).any():
        materials.append(_material(None, unlit))
    content = document_content(path.stem, primitives, materials, offset, standing)
    content["asset"] = asset_of(provenance)
    if images:
        content |= textures([document.view(image) for image in images], image_format)
    declare(content, unlit, IMAGE_EXTENSIONS.get(image_format) if images else None)
    document.write(path, content)


def write_colored_glb(
    path: Path,
    model: ColoredMesh,
    unlit: bool = True,
    standing: Standing | None = None,
    provenance: Provenance = NOTHING,
) -> None:
    """The same with a color per vertex (COLOR_0): linear light as the standard has it, in float32,
    since programs misread 16-bit integers. The vertices stay in their order. Raises OSError.
    """
    document = Document()
    offset = offset_of(model.vertices)
    attributes = {"POSITION": document.vectors(model.vertices - offset, bounds=True)}
    if model.normals is not None:
        attributes["NORMAL"] = document.vectors(units(model.normals))
    attributes["COLOR_0"] = document.vectors(linear(model.colors))
    indices = document.indices(model.faces.ravel())
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    material = _material(None, unlit) | {"name": "vertex colors"}
    material["pbrMetallicRoughness"]["baseColorFactor"] = [1, 1, 1, 1]
    content = document_content(path.stem, [primitive], [material], offset, standing)
    content["asset"] = asset_of(provenance)
    declare(content, unlit, None)
    document.write(path, content)


def offset_of(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """What positions count from."""
    if single_is_enough(vertices):
        return np.zeros(3)
    return np.round((vertices.min(0) + vertices.max(0)) / 2)


def document_content(
    name: str,
    primitives: list[dict[str, Any]],
    materials: list[dict[str, Any]],
    offset: NDArray[np.float64],
    standing: Standing | None,
) -> dict[str, Any]:
    """The scene: one mesh that stands as `standing` says."""
    node: dict[str, Any] = {"mesh": 0, "name": name}
    if offset.any():
        node["translation"] = offset.tolist()
    nodes = [node]
    if standing is not None and not standing.as_is:
        turn = {"rotation": list(standing.rotation), "scale": [standing.metres] * 3}
        nodes = [{"name": UPRIGHT, "children": [1], **turn}, node]
    return {
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": [{"primitives": primitives}],
        "materials": materials,
    }


def asset_of(provenance: Provenance) -> dict[str, Any]:
    """Who made it, and whose the photos are."""
    asset: dict[str, Any] = {"version": "2.0", "generator": GENERATOR}
    if provenance.copyright:
        asset["copyright"] = provenance.copyright
    if provenance.facts:
        asset["extras"] = {"texproj": dict(provenance.facts)}
    return asset


def declare(content: dict[str, Any], unlit: bool, images: str | None) -> None:
    """Name the extensions that are used, and the one without which nothing can be seen."""
    used = [name for name in (UNLIT if unlit else None, images) if name]
    if used:
        content["extensionsUsed"] = used
    if images:
        content["extensionsRequired"] = [images]


def textures(views: list[int], image_format: GlbImage) -> dict[str, Any]:
    """Images, textures and the one way to sample them: linear, never across the border."""
    sampler = {
        "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR,
        "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE,
    }  # fmt: skip
    return {
        "images": [{"mimeType": f"image/{image_format}", "bufferView": view} for view in views],
        "samplers": [sampler],
        "textures": [
            {"sampler": 0, **_source(i, IMAGE_EXTENSIONS.get(image_format))}
            for i in range(len(views))
        ],
    }


def _source(image: int, extension: str | None) -> dict[str, Any]:
    source = {"source": image}
    return {"extensions": {extension: source}} if extension else source


def page_primitive(
    document: Document, model: TexturedMesh, page: int, offset: NDArray[np.float64]
) -> dict[str, Any]:
    """The faces of one page, one glTF vertex per pair of vertex and texture vertex."""
    vertex, texel, indices = _pairs(model, page)
    attributes = {"POSITION": document.vectors(model.vertices[vertex] - offset, bounds=True)}
    if model.normals is not None:
        attributes["NORMAL"] = document.vectors(units(model.normals[vertex]))
    if page >= 0:
        uv_down = model.uv[texel] * (1, -1) + (0, 1)
        attributes["TEXCOORD_0"] = document.vectors(uv_down)
    material = page if page >= 0 else len(model.pages)
    return {
        "attributes": attributes,
        "indices": document.indices(indices.ravel()),
        "material": material,
    }


def _pairs(
    model: TexturedMesh, page: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Vertex and texture vertex of each glTF vertex of a page, and the faces' rows of them."""
    rows = model.page_of_face == page
    vertex = model.faces[rows].ravel()
    if page < 0:
        known, indices = np.unique(vertex, return_inverse=True)
        return known, np.zeros_like(known), indices
    texel = model.uv_faces[rows].ravel()
    vertex_of = np.full(len(model.uv), -1, np.int64)
    vertex_of[texel] = vertex
    if (vertex_of[texel] == vertex).all():  # a texture vertex belongs to one vertex, as usual
        used = np.flatnonzero(vertex_of >= 0)
        number = np.cumsum(vertex_of >= 0) - 1
        return vertex_of[used], used, number[texel]
    pairs, indices = np.unique(vertex * np.int64(len(model.uv)) + texel, return_inverse=True)
    return pairs // len(model.uv), pairs % len(model.uv), indices


def units(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals that are all of length 1: a vertex without a face has none, and gets one."""
    return np.where(normals.any(axis=1, keepdims=True), normals, (0.0, 0.0, 1.0))


def linear(colors: NDArray[Any]) -> NDArray[np.float32]:
    """(V, 3) linear light in 0..1 of any kind of colors; alpha is left out."""
    if colors.dtype.kind == "f":
        return np.clip(colors, 0, 1)
    top = int(np.iinfo(colors.dtype).max)
    return linear_from_srgb(np.arange(top + 1) / top)[colors[:, :3]]


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
        material["extensions"] = {UNLIT: {}}
    return material
