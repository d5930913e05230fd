"""What a color projection hands over."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from texproj.layout import Surface
from texproj.mesh import Mesh, Parts, TexturedMesh, vertex_normals

if TYPE_CHECKING:
    from texproj.unwrap.atlas import Atlas
    from texproj.unwrap.kept import Pages


@dataclass(frozen=True, eq=False)
class VertexColors:
    """One color per vertex of the mesh.

    rgb: (V, 3) float32 linear light (1 = white of the photos), also where no photo sees the
    vertex: there it is filled from the surface around; weight: (V,) float32 summed weight of the
    photos, 0 = unseen; photo_count: (V,) uint16; quality: numbers for the report; failed: photos
    that could not be used by name, and why.
    """

    rgb: NDArray[np.float32]
    weight: NDArray[np.float32]
    photo_count: NDArray[np.uint16]
    quality: dict[str, Any] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Texture:
    """Colors on the pages of an atlas.

    pages: one (h, w, 3) image per page, sRGB encoded, uint8 or uint16, row 0 on top; texels that
    no photo sees and those between the charts are filled from around them.
    photo_count: one (h, w) uint8 image per page: how many photos a texel's color comes from,
    0 = unseen or outside of every chart; quality: numbers for the report; failed: photos that
    could not be used by name, and why; kept: the pages of the mesh's own layout where the atlas is
    that; notes: what a person should know of the layout, one sentence each.
    """

    atlas: Atlas
    pages: tuple[NDArray[Any], ...]
    photo_count: tuple[NDArray[np.uint8], ...]
    quality: dict[str, Any] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    kept: Pages | None = None
    notes: tuple[str, ...] = ()


def textured_mesh(mesh: Mesh, texture: Texture, normals: bool = True) -> TexturedMesh:
    """The mesh with its texture, in the conventions of model files (v up, 0..1); with nodes, names
    and texture coordinates as its file has them where those are kept.
    """
    units = vertex_normals(mesh) if normals else None
    if texture.kept is not None and mesh.layout is not None:
        layout, pages = mesh.layout, texture.kept
        surfaces = [layout.materials[m].surface if m >= 0 else Surface() for m in pages.materials]
        parts = Parts(
            pages.names, layout.nodes, layout.node_of_face, layout.uv_down, tuple(surfaces)
        )
        return TexturedMesh(
            mesh.vertices, mesh.faces, layout.uv_up, np.maximum(layout.faces, 0),
            pages.page_of_face, texture.pages, units, parts,
        )  # fmt: skip
    atlas = texture.atlas
    page_of_uv = np.zeros(len(atlas.uv_px), np.intp)
    page_of_uv[atlas.faces.ravel()] = np.repeat(np.maximum(atlas.page_of_face, 0), 3)
    size = np.array(atlas.page_sizes, float)[page_of_uv]
    uv = atlas.uv_px / size
    uv[:, 1] = 1 - uv[:, 1]
    return TexturedMesh(
        mesh.vertices, mesh.faces, uv, atlas.faces, atlas.page_of_face, texture.pages, units
    )
