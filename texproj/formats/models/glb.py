"""Binary glTF 2.0: a mesh with the texture's pages inside, or with vertex colors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from texproj.formats.models.binary import Box, Document
from texproj.formats.models.draco import DracoDocument, fineness_of
from texproj.formats.models.page_names import UNTEXTURED, page_names
from texproj.formats.models.precision import single_is_enough
from texproj.layout import Surface, SurfaceMap
from texproj.mesh import ColoredMesh, Parts, TexturedMesh
from texproj.photo import linear_from_srgb
from texproj.provenance import GENERATOR, NOTHING, Provenance
from texproj.standing import Standing

GlbImage = Literal["png", "jpeg", "webp", "ktx2"]
"""What viewers read: png and jpeg by the standard itself, the others by an extension."""

GLB_IMAGES: dict[str, GlbImage] = {
    ".png": "png", ".jpg": "jpeg", ".webp": "webp", ".ktx2": "ktx2",
}  # fmt: skip
"""By the suffix of an image's file."""

IMAGE_EXTENSIONS = {"webp": "EXT_texture_webp", "ktx2": "KHR_texture_basisu"}
UNLIT = "KHR_materials_unlit"
UPRIGHT = "upright"
"""Name of the node above all others that turns and scales the scan, where it does not stand as glTF
has it: below it everything is in the scan's frame."""

LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE, REPEAT = 9729, 9987, 33071, 10497
SAMPLER = {
    "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR,
    "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE,
}  # fmt: skip


def write_glb(
    path: Path,
    model: TexturedMesh,
    images: Sequence[Path],
    unlit: bool = True,
    compressed: bool = False,
    standing: Standing | None = None,
    provenance: Provenance = NOTHING,
) -> None:
    """Write one node with a primitive, a material and an image per page of the texture, or the
    model's own nodes with their names (`parts`).

    Positions stay those of the mesh file; a node above (`UPRIGHT`) makes it stand as `standing`
    says. They are float32; where that is not enough they count
    from the middle of the model and the node is moved there. `unlit` shows the colors as they
    were photographed (KHR_materials_unlit), viewers without it light them. images: the files of
    the pages, all of one kind that their suffix tells, 8 bits as the standard has it for colors,
    then those of the model's normal map if it shall be there; webp and ktx2 are marked as required,
    there is no second copy for viewers without them. compressed: by Draco, required as well.
    `provenance` stands in the asset: copyright, and its facts under extras.texproj. Raises OSError,
    and OutputError for what Draco cannot hold.
    """
    document = DracoDocument(fineness_of(model)) if compressed else Document()
    image_format = GLB_IMAGES[images[0].suffix] if images else "png"
    names = page_names(model)
    pages = len(model.pages)
    bumps = len(images) - pages  # as many again, or none
    if bumps <= 0:
        model = replace(model, normal_map=None)
    materials = [_material(i, unlit, names[i]) for i in range(min(pages, len(images)))]
    for i, material in enumerate(materials if bumps > 0 else ()):
        material["normalTexture"] = {"index": pages + i}
    if (model.page_of_face < 0).any():
        materials.append(_material(None, unlit, UNTEXTURED))
    if model.parts is None:
        offset = offset_of(model.vertices)
        everywhere = np.ones(len(model.faces), bool)
        primitives = primitives_of(document, model, everywhere, offset)
        content = document_content(path.stem, primitives, materials, offset, standing)
    else:
        content = _scene(document, model, model.parts, standing) | {"materials": materials}
    content["asset"] = asset_of(provenance)
    if images:
        content |= textures([document.view(image) for image in images], image_format)
        if model.parts is not None:
            _add_surfaces(document, content, model.parts.surfaces)
        if model.parts is not None and not _in_one_tile(model.parts.uv_down):
            content["samplers"] = [SAMPLER | {"wrapS": REPEAT, "wrapT": REPEAT}]
    needed = IMAGE_EXTENSIONS.get(image_format, "") if images else ""
    declare(content, unlit, *(name for name in (needed, document.extension) if name))
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
    material = _material(None, unlit, "vertex colors")
    material["pbrMetallicRoughness"]["baseColorFactor"] = [1, 1, 1, 1]
    content = document_content(path.stem, [primitive], [material], offset, standing)
    content["asset"] = asset_of(provenance)
    declare(content, unlit)
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
    meshes = [{"primitives": primitives}]
    return _upright([node], [0], standing) | {"meshes": meshes, "materials": materials}


def _upright(
    nodes: list[dict[str, Any]], roots: list[int], standing: Standing | None
) -> dict[str, Any]:
    """The scene of these nodes, below one that turns them where they do not stand upright."""
    if standing is not None and not standing.as_is:
        turn = {"rotation": list(standing.rotation), "scale": [standing.metres] * 3}
        nodes = [*nodes, {"name": UPRIGHT, "children": roots, **turn}]
        roots = [len(nodes) - 1]
    return {"scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes}


def _scene(
    document: Document, model: TexturedMesh, parts: Parts, standing: Standing | None
) -> dict[str, Any]:
    """The nodes of the model's parts with their meshes, positions in their own frames."""
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    extra: list[dict[str, Any]] = []
    for number, part in enumerate(parts.nodes):
        node: dict[str, Any] = {"name": f"{part.name}_" if part.name == UPRIGHT else part.name}
        node |= {key: list(values) for key, values in part.placing.items()}
        children = list(part.children)
        rows = parts.node_of_face == number
        if rows.any():
            own, offset = _in_frame(model, part.world)
            primitives = primitives_of(document, own, rows, offset)
            meshes.append({"primitives": primitives, "name": part.mesh_name or part.name})
            shown = {"mesh": len(meshes) - 1}
            if offset.any():
                children.append(len(parts.nodes) + len(extra))
                extra.append({"name": part.name, "translation": offset.tolist(), **shown})
            else:
                node |= shown
        if children:
            node["children"] = children
        nodes.append(node)
    held = {child for part in parts.nodes for child in part.children}
    roots = [i for i in range(len(nodes)) if i not in held]
    return _upright([*nodes, *extra], roots, standing) | {"meshes": meshes}


def _in_frame(
    model: TexturedMesh, world: NDArray[np.float64]
) -> tuple[TexturedMesh, NDArray[np.float64]]:
    """The model in the frame of a node, and what its positions count from there."""
    if (world == np.eye(4)).all():
        return model, offset_of(model.vertices)
    inverse = np.linalg.inv(world)
    vertices = model.vertices @ inverse[:3, :3].T + inverse[:3, 3]
    normals, faces, uv_faces = model.normals, model.faces, model.uv_faces
    if normals is not None:
        normals = normals @ world[:3, :3]
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    if np.linalg.det(world[:3, :3]) < 0:
        faces, uv_faces = faces[:, ::-1], uv_faces[:, ::-1]
    own = replace(model, vertices=vertices, faces=faces, uv_faces=uv_faces, normals=normals)
    return own, offset_of(vertices)


def _in_one_tile(uv: NDArray[np.float64]) -> bool:
    return bool(((uv >= 0) & (uv <= 1)).all())


def primitives_of(
    document: Document,
    model: TexturedMesh,
    rows: NDArray[np.bool_],
    offset: NDArray[np.float64],
) -> list[dict[str, Any]]:
    """One primitive for each page of the chosen faces (F,)."""
    pages = np.unique(model.page_of_face[rows]).tolist()
    out = []
    for page in pages:
        of_page = rows & (model.page_of_face == page)
        attributes, corners = _arrays(model, page, of_page, offset)
        primitive = document.primitive(attributes, corners, box_of(model.vertices - offset))
        out.append(primitive | {"material": page if page >= 0 else len(model.pages)})
    return out


def box_of(vertices: NDArray[np.float64]) -> Box:
    """Of (n, 3) positions."""
    low = vertices.min(axis=0)
    return low, float((vertices.max(axis=0) - low).max())


def asset_of(provenance: Provenance) -> dict[str, Any]:
    """Who made it, and whose the photos are."""
    asset: dict[str, Any] = {"version": "2.0", "generator": GENERATOR}
    if provenance.copyright:
        asset["copyright"] = provenance.copyright
    if provenance.facts:
        asset["extras"] = {"texproj": dict(provenance.facts)}
    return asset


def declare(content: dict[str, Any], unlit: bool, *needed: str) -> None:
    """Name the extensions that are used, and those without which nothing can be seen."""
    used = [*((UNLIT,) if unlit else ()), *needed]
    if used:
        content["extensionsUsed"] = used
    if needed:
        content["extensionsRequired"] = list(needed)


def textures(views: list[int], image_format: GlbImage) -> dict[str, Any]:
    """Images, textures and the one way to sample them: linear, never across the border."""
    return {
        "images": [{"mimeType": f"image/{image_format}", "bufferView": view} for view in views],
        "samplers": [SAMPLER],
        "textures": [
            {"sampler": 0, **_source(i, IMAGE_EXTENSIONS.get(image_format))}
            for i in range(len(views))
        ],
    }


def _source(image: int, extension: str | None) -> dict[str, Any]:
    source = {"source": image}
    return {"extensions": {extension: source}} if extension else source


def _arrays(
    model: TexturedMesh, page: int, rows: NDArray[np.bool_], offset: NDArray[np.float64]
) -> tuple[dict[str, NDArray[Any]], NDArray[Any]]:
    """Faces (F,) of one page: values by the standard's names, one glTF vertex per pair of vertex
    and texture vertex, and (3 F,) corners.
    """
    vertex, texel, indices = _pairs(model, page, rows)
    attributes: dict[str, NDArray[Any]] = {"POSITION": model.vertices[vertex] - offset}
    if model.normals is not None:
        attributes["NORMAL"] = units(model.normals[vertex])
    if page >= 0:
        kept = model.parts.uv_down[texel] if model.parts is not None else None
        attributes["TEXCOORD_0"] = model.uv[texel] * (1, -1) + (0, 1) if kept is None else kept
        if model.normal_map is not None and model.normals is not None:
            attributes["TANGENT"] = model.normal_map.tangents[texel]
    return attributes, indices.ravel()


def _add_surfaces(document: Document, content: dict[str, Any], surfaces: Sequence[Surface]) -> None:
    """Put into the materials of the pages what those of the mesh said beside their colors; an
    image that several share is there once.
    """
    known: dict[Any, int] = {}
    for material, surface in zip(content["materials"], surfaces, strict=False):
        pbr = material["pbrMetallicRoughness"]
        factors = {"roughnessFactor": surface.roughness, "metallicFactor": surface.metallic}
        pbr |= {key: float(np.clip(f, 0, 1)) for key, f in factors.items() if f is not None}
        for one in surface.maps:
            if one.image not in known:
                blob = (
                    one.image if isinstance(one.image, Path) else np.frombuffer(one.image, np.uint8)
                )
                image = {"mimeType": one.mime, "bufferView": document.view(blob)}
                content["images"].append(image)
                content["textures"].append({"sampler": 0, "source": len(content["images"]) - 1})
                known[one.image] = len(content["textures"]) - 1
            _put_map(material, one, known[one.image])


def _put_map(material: dict[str, Any], one: SurfaceMap, texture: int) -> None:
    told: dict[str, Any] = {"index": texture}
    if one.role == "metallicRoughnessTexture":
        material["pbrMetallicRoughness"][one.role] = told
        return
    if one.strength != 1:
        told["scale" if one.role == "normalTexture" else "strength"] = one.strength
    material[one.role] = told


def _pairs(
    model: TexturedMesh, page: int, rows: NDArray[np.bool_]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Vertex and texture vertex of each glTF vertex of faces (F,), and the faces' rows of them."""
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


def _material(page: int | None, unlit: bool, name: str) -> dict[str, Any]:
    surface: dict[str, Any] = {"metallicFactor": 0, "roughnessFactor": 1}
    if page is None:
        surface["baseColorFactor"] = [0.2, 0.2, 0.2, 1]
    else:
        surface["baseColorTexture"] = {"index": page}
    material: dict[str, Any] = {
        "name": name,
        "pbrMetallicRoughness": surface,
        "doubleSided": True,
    }
    if unlit:
        material["extensions"] = {UNLIT: {}}
    return material
