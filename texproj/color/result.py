"""What a color projection hands over."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from texproj.mesh import Mesh, TexturedMesh, vertex_normals

if TYPE_CHECKING:
    from texproj.unwrap.atlas import Atlas


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
    could not be used by name, and why.
    """

    atlas: Atlas
    pages: tuple[NDArray[Any], ...]
    photo_count: tuple[NDArray[np.uint8], ...]
    quality: dict[str, Any] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)


def textured_mesh(mesh: Mesh, texture: Texture, normals: bool = True) -> TexturedMesh:
    """The mesh with its texture, in the conventions of model files (v up, 0..1)."""
    atlas = texture.atlas
    page_of_uv = np.zeros(len(atlas.uv_px), np.intp)
    page_of_uv[atlas.faces.ravel()] = np.repeat(atlas.page_of_face, 3)
    size = np.array(atlas.page_sizes, float)[page_of_uv]
    uv = atlas.uv_px / size
    uv[:, 1] = 1 - uv[:, 1]
    return TexturedMesh(
        mesh.vertices, mesh.faces, uv, atlas.faces, atlas.page_of_face, texture.pages,
        vertex_normals(mesh) if normals else None,
    )  # fmt: skip
