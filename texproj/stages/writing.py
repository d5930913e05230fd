"""The files of a colored model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texproj.color.result import Texture, VertexColors
from texproj.formats.models import encode_pages, write_glb, write_obj, write_ply
from texproj.mesh import Mesh, MeshSource, TexturedMesh, vertex_normals
from texproj.photo import srgb_from_linear

PLY, GLB, OBJ = "model.ply", "model.glb", "model.obj"


def write_vertices(folder: Path, source: MeshSource, colors: VertexColors) -> tuple[str, ...]:
    """Write the mesh as it was in its file, each vertex with its color; returns the file names.

    A vertex that the repair dropped has no color: it is mid-gray.
    """
    encoded = np.round(srgb_from_linear(colors.rgb) * 255).astype(np.uint8)
    with_none = np.concatenate([encoded, np.full((1, 3), 128, np.uint8)])
    write_ply(
        folder / PLY, source.source_vertices, source.source_faces,
        with_none[source.vertex_of_source],
    )  # fmt: skip
    return (PLY,)


def write_texture(folder: Path, mesh: Mesh, texture: Texture) -> tuple[str, ...]:
    """Write the textured mesh as glb and as obj with its images; returns the file names."""
    model = textured_mesh(mesh, texture)
    images = encode_pages(model.pages, "png")
    write_glb(folder / GLB, model, "png", images=images)
    written = write_obj(folder / OBJ, model, "png", images)
    return (GLB, *(path.name for path in written))


def textured_mesh(mesh: Mesh, texture: Texture) -> TexturedMesh:
    """The mesh with its texture, in the conventions of model files (v up, 0..1)."""
    atlas = texture.atlas
    page_of_uv = np.zeros(len(atlas.uv_px), np.intp)
    page_of_uv[atlas.faces.ravel()] = np.repeat(atlas.page_of_face, 3)
    size = np.array(atlas.page_sizes, float)[page_of_uv]
    uv = atlas.uv_px / size
    uv[:, 1] = 1 - uv[:, 1]
    return TexturedMesh(
        mesh.vertices, mesh.faces, uv, atlas.faces, atlas.page_of_face, texture.pages,
        vertex_normals(mesh),
    )  # fmt: skip
