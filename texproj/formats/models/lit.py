"""Binary glTF 2.0 of a surface that is known: base color, roughness, metals, to be lit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texproj.arrays import Index
from texproj.formats.models.binary import Document
from texproj.formats.models.glb import (
    asset_of,
    declare,
    document_content,
    linear,
    offset_of,
    primitives_of,
    textures,
    units,
)
from texproj.mesh import ColoredMesh, TexturedMesh
from texproj.provenance import NOTHING, Provenance
from texproj.standing import Standing

SPECULAR = "KHR_materials_specular"
USUAL_F0 = 0.04
"""What a dielectric mirrors at normal incidence where nothing else is said: an index of 1.5."""


@dataclass(frozen=True)
class Gloss:
    """One material. name; roughness and metallic: glTF's factors; f0: what a dielectric mirrors at
    normal incidence, None where it is not known.
    """

    name: str
    roughness: float
    metallic: float
    f0: float | None = None

    @property
    def material(self) -> dict[str, Any]:
        """As glTF has it, for vertex colors."""
        out: dict[str, Any] = {
            "name": self.name,
            "doubleSided": True,
            "pbrMetallicRoughness": {
                "baseColorFactor": [1, 1, 1, 1],
                "metallicFactor": self.metallic,
                "roughnessFactor": self.roughness,
            },
        }
        if self.f0 is not None:
            factor = self.f0 / USUAL_F0
            out["extensions"] = {SPECULAR: {"specularColorFactor": [factor] * 3}}
        return out


@dataclass(frozen=True, eq=False)
class Parts:
    """What faces are made of. gloss: the materials; face: (F,) the number of each face's."""

    gloss: Sequence[Gloss]
    face: Index


def write_glossy_glb(
    path: Path,
    model: ColoredMesh,
    parts: Parts,
    standing: Standing | None = None,
    provenance: Provenance = NOTHING,
) -> None:
    """Write base colors per vertex and a primitive per material; the vertices stay in their order,
    shared by all primitives. Raises OSError.
    """
    document = Document()
    offset = offset_of(model.vertices)
    attributes = {"POSITION": document.vectors(model.vertices - offset, bounds=True)}
    if model.normals is not None:
        attributes["NORMAL"] = document.vectors(units(model.normals))
    attributes["COLOR_0"] = document.vectors(linear(model.colors))
    used = np.unique(parts.face)
    primitives = [
        {
            "attributes": attributes,
            "indices": document.indices(model.faces[parts.face == number].ravel()),
            "material": material,
        }
        for material, number in enumerate(used)
    ]
    materials = [parts.gloss[number].material for number in used]
    content = document_content(path.stem, primitives, materials, offset, standing)
    content["asset"] = asset_of(provenance)
    declare(content, False)
    if any("extensions" in material for material in materials):
        content["extensionsUsed"] = [*content.get("extensionsUsed", ()), SPECULAR]
    document.write(path, content)


@dataclass(frozen=True)
class Images:
    """Files of the pages, png or jpeg. base: base color; orm: occlusion, roughness, metallic;
    normal: tangent-space normals, none where there are none; specular: sRGB, what a dielectric
    mirrors at normal incidence over `USUAL_F0` and `specular_factor`, none where it is not known.
    """

    base: Sequence[Path]
    orm: Sequence[Path]
    normal: Sequence[Path] = ()
    specular: Sequence[Path] = ()
    specular_factor: float = 1.0


def write_lit_glb(
    path: Path,
    model: TexturedMesh,
    images: Images,
    standing: Standing | None = None,
    provenance: Provenance = NOTHING,
) -> None:
    """Write a textured surface with all that its pages say. Raises OSError."""
    document = Document()
    offset = offset_of(model.vertices)
    primitives = primitives_of(document, model, np.ones(len(model.faces), bool), offset)
    materials = [_page_material(page, images) for page in range(len(images.base))]
    if (model.page_of_face < 0).any():
        materials.append(Gloss("untextured", 1.0, 0.0).material)
    content = document_content(path.stem, primitives, materials, offset, standing)
    content["asset"] = asset_of(provenance)
    files = (*images.base, *images.orm, *images.normal, *images.specular)
    content |= textures([document.view(file) for file in files], "png")
    declare(content, False)
    if images.specular:
        content["extensionsUsed"] = [*content.get("extensionsUsed", ()), SPECULAR]
    document.write(path, content)


def _page_material(page: int, images: Images) -> dict[str, Any]:
    """The material of a page; textures stand base by base, then all ORM, then all normals, if there
    are any, then all specular ones.
    """
    count = len(images.base)
    orm = {"index": count + page}
    out: dict[str, Any] = {
        "name": f"page_{page}",
        "doubleSided": True,
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": page},
            "metallicRoughnessTexture": orm,
        },
        "occlusionTexture": orm,
    }
    if images.normal:
        out["normalTexture"] = {"index": 2 * count + page}
    if images.specular:
        place = {"index": 2 * count + len(images.normal) + page}
        factor = [images.specular_factor] * 3
        mirror = {"specularColorTexture": place, "specularColorFactor": factor}
        out["extensions"] = {SPECULAR: mirror}
    return out
