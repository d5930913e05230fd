"""What a glTF brings beside its triangles: texture coordinates, materials, nodes and names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.formats.foreign import Broken
from texproj.formats.meshes.gltf import GltfPart
from texproj.formats.meshes.gltf_document import (
    GltfDocument,
    inline_bytes,
    list_of,
    object_of,
)
from texproj.layout import NO_PLACE, Layout, Material, Node, Surface, SurfaceMap

TRANSFORM = "KHR_texture_transform"
OTHER_IMAGES = ("EXT_texture_webp", "EXT_texture_avif")
"""Where a texture names its image when it is no png or jpeg; others (Basis) cannot be read."""
PLACING = {"matrix": 16, "rotation": 4, "translation": 3, "scale": 3}
LONGEST_NAME = 200
ROLES = {
    "metallicRoughnessTexture": "", "normalTexture": "scale", "occlusionTexture": "strength",
}  # fmt: skip
"""Maps that are kept, and glTF's word for the strength of each."""
PBR_ROLES = ("metallicRoughnessTexture",)
"""Those that stand under pbrMetallicRoughness."""
MOST_FACTOR = 1e6


def gltf_layout(document: GltfDocument, parts: list[GltfPart]) -> Layout | None:
    """Where the triangles of `placed_together` lie in textures; None where no part says so.

    Raises Broken for what contradicts itself; the triangles are none the worse.
    """
    coordinates = [_coordinates(document, part) for part in parts]
    if all(uv is None for uv in coordinates):
        return None
    nodes, row_of_node = _nodes(document, parts)
    uv_rows, faces, offset = [np.zeros((0, 2))], [], 0
    for part, uv in zip(parts, coordinates, strict=True):
        corners = part.corners[:, ::-1] if part.mirrored else part.corners
        if uv is None:
            faces.append(np.full(corners.shape, NO_PLACE))
            continue
        inside = (corners >= 0) & (corners < len(uv))
        faces.append(np.where(inside, corners + offset, NO_PLACE))
        uv_rows.append(uv)
        offset += len(uv)
    counts = [len(part.corners) for part in parts]
    materials = [_number(part.primitive.get("material")) for part in parts]
    known = len(document.entries("materials"))
    return Layout(
        np.concatenate(uv_rows),
        np.concatenate(faces).astype(np.int32),
        np.repeat([m if m < known else NO_PLACE for m in materials], counts).astype(np.int32),
        np.repeat([row_of_node[part.node] for part in parts], counts).astype(np.int32),
        tuple(_material(document, i) for i in range(known)),
        nodes,
        v_down=True,
    )


def _number(value: Any) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) else NO_PLACE


def _name(entry: dict[str, Any], otherwise: str) -> str:
    name = entry.get("name")
    return name[:LONGEST_NAME] if isinstance(name, str) and name else otherwise


def _base_color(document: GltfDocument, material: Any) -> dict[str, Any]:
    """What a material says of the texture of its colors; empty if it has none."""
    if _number(material) == NO_PLACE:
        return {}
    entry = document.entry("materials", material)
    surface = object_of(entry.get("pbrMetallicRoughness", {}), "pbrMetallicRoughness")
    return object_of(surface.get("baseColorTexture", {}), "baseColorTexture")


def _coordinates(document: GltfDocument, part: GltfPart) -> NDArray[np.float64] | None:
    """(n, 2) coordinates of a part's vertices in the texture of its colors, if it has any."""
    texture = _base_color(document, part.primitive.get("material"))
    change = object_of(
        object_of(texture.get("extensions", {}), "extensions").get(TRANSFORM, {}), TRANSFORM
    )
    number = _number(change.get("texCoord", texture.get("texCoord", 0)))
    attributes = object_of(part.primitive.get("attributes"), "attributes")
    if f"TEXCOORD_{number}" not in attributes:
        return None
    uv = document.attribute(part.primitive, f"TEXCOORD_{number}", 2).astype(np.float64)
    if change:
        if change.get("rotation", 0) != 0:
            raise Broken(f"a texture is turned by {TRANSFORM}")
        uv = uv * _pair(change, "scale", 1.0) + _pair(change, "offset", 0.0)
    if not np.isfinite(uv).all():
        raise Broken("texture coordinates that are no numbers")
    return uv


def _pair(entry: dict[str, Any], key: str, default: float) -> NDArray[np.float64]:
    values = entry.get(key, [default, default])
    try:
        pair = np.array(values, np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        pair = np.zeros(0)
    if len(pair) != 2 or not np.isfinite(pair).all():
        raise Broken(f"{key} of {TRANSFORM} must be two numbers")
    return pair


def _material(document: GltfDocument, number: int) -> Material:
    entry = document.entry("materials", number)
    name = _name(entry, f"material_{number}")
    surface = object_of(entry.get("pbrMetallicRoughness", {}), "pbrMetallicRoughness")
    try:
        factor = np.array(surface.get("baseColorFactor", (1, 1, 1, 1)), np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        factor = np.zeros(0)
    if len(factor) != 4 or not np.isfinite(factor).all():
        raise Broken("baseColorFactor must be four numbers")
    red, green, blue = np.clip(factor[:3], 0, 1).tolist()
    texture = _base_color(document, number)
    image, why = _image(document, texture["index"]) if "index" in texture else (None, "")
    told = _surface(document, entry, surface, _place(texture))
    return Material(name, image, (red, green, blue), why, surface=told)


def _surface(
    document: GltfDocument, entry: dict[str, Any], pbr: dict[str, Any], place: Any
) -> Surface:
    """What a material says beside its colors; maps at other coordinates than these are left out.
    place: where the texture of the colors lies.
    """
    maps = []
    for role, strength in ROLES.items():
        texture = (pbr if role in PBR_ROLES else entry).get(role)
        if not isinstance(texture, dict) or (place is not None and _place(texture) != place):
            continue
        image, _ = _image(document, texture.get("index"))
        if image is not None and (mime := _mime(image)):
            maps.append(SurfaceMap(role, image, mime, _factor(texture.get(strength), 1.0) or 1.0))
    usual = 1.0 if any(one.role in PBR_ROLES for one in maps) else None
    roughness, metallic = (
        _factor(pbr.get(f"{word}Factor"), usual) for word in ("roughness", "metallic")
    )
    return Surface(tuple(maps), roughness, metallic)


def _place(texture: dict[str, Any]) -> Any:
    """Which coordinates a texture takes, and how they are changed; None where there is none."""
    if "index" not in texture:
        return None
    extensions = texture.get("extensions", {})
    change = extensions.get(TRANSFORM, {}) if isinstance(extensions, dict) else {}
    return texture.get("texCoord", 0), change


def _mime(image: Path | bytes) -> str:
    """Of the kinds that a glb holds by itself; empty for others, and where no file is there."""
    head = image if isinstance(image, bytes) else b""
    if isinstance(image, Path):
        try:
            with image.open("rb") as file:
                head = file.read(8)
        except OSError:
            return ""
    kinds = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
    return next((kind for magic, kind in kinds.items() if head.startswith(magic)), "")


def _factor(value: Any, usual: float | None) -> float | None:
    """A number of possible size; `usual` for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return usual
    return float(value) if abs(value) < MOST_FACTOR else usual


def _image(document: GltfDocument, texture: Any) -> tuple[Any, str]:
    """The image of a texture, a file or bytes, or why there is none."""
    try:
        entry = document.entry("textures", texture)
        extensions = object_of(entry.get("extensions", {}), "extensions")
        sources = [extensions[name].get("source") for name in OTHER_IMAGES if name in extensions]
        source = (sources or [entry.get("source")])[0]
        if source is None:
            return None, "its image is of a kind that is not read"
        image = document.entry("images", source)
        if "bufferView" in image:
            return document.view_bytes(image["bufferView"]), ""
        uri = image.get("uri")
        if not isinstance(uri, str):
            return None, "its image is nowhere"
        return (inline_bytes(uri) if uri.startswith("data:") else document.beside(uri)), ""
    except (Broken, AttributeError) as error:
        return None, str(error)


def _nodes(
    document: GltfDocument, parts: list[GltfPart]
) -> tuple[tuple[Node, ...], dict[int, int]]:
    """The nodes of the scene, and the row of each by its number in the file."""
    world = {part.node: part.world for part in parts}
    row: dict[int, int] = {}
    waiting = list(reversed(document.roots()))
    while waiting:
        number = waiting.pop()
        row[number] = len(row)
        waiting += reversed(list_of(document.entry("nodes", number), "children"))
    nodes = []
    for number in row:
        entry = document.entry("nodes", number)
        mesh_name = _name(document.entry("meshes", entry["mesh"]), "") if "mesh" in entry else ""
        placing = {k: _values(entry[k], count) for k, count in PLACING.items() if k in entry}
        children = tuple(row[child] for child in list_of(entry, "children"))
        where = world.get(number, np.eye(4))
        nodes.append(Node(_name(entry, f"node_{number}"), mesh_name, children, placing, where))
    return tuple(nodes), row


def _values(values: Any, count: int) -> tuple[float, ...]:
    return tuple(np.array(values, np.float64).reshape(count).tolist())
