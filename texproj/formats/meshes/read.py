"""A mesh file of any kind to vertices and triangles, and what its reader has to say about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from texproj.errors import InputError
from texproj.formats.documents import read_bytes
from texproj.formats.foreign import Broken
from texproj.formats.meshes.gltf import gltf_parts, placed_together
from texproj.formats.meshes.gltf_document import GltfDocument
from texproj.formats.meshes.gltf_layout import gltf_layout
from texproj.formats.meshes.kinds import MESH_SUFFIXES
from texproj.formats.meshes.obj import ObjFile
from texproj.formats.meshes.off import read_off
from texproj.formats.meshes.ply import ply_header, read_ply
from texproj.formats.meshes.ply_layout import ply_layout
from texproj.formats.meshes.polygons import Faces, Vertices
from texproj.formats.meshes.scene import read_stl
from texproj.layout import Layout

MOST_BYTES = 32 << 30
"""The file is read whole; 300 million faces take less."""


@dataclass(frozen=True, eq=False)
class MeshFile:
    """What a mesh file holds: (V, 3) float64 vertices, (F, 3) int32 triangles, both as the file
    has them; layout: where these lie in textures, if it says so; notes: what of it is not used, one
    sentence each.
    """

    vertices: Vertices
    faces: Faces
    layout: Layout | None = None
    notes: tuple[str, ...] = ()


def read_mesh(path: Path) -> tuple[Vertices, Faces]:
    """Vertices and triangles alone. Raises InputError; see `read_mesh_file`."""
    mesh = read_mesh_file(path)
    return mesh.vertices, mesh.faces


def read_mesh_file(path: Path) -> MeshFile:
    """A ply, obj, stl, off, glb or gltf file.

    As the file has it: nothing is welded or dropped, doubles stay doubles, polygons become
    triangles, the parts of a scene are placed by their transforms and put one after the other.
    Texture coordinates that contradict themselves are left out, with a note.
    Raises InputError for a file that is missing, broken, of another kind or without triangles.
    """
    kind = path.suffix.lower()
    if kind not in MESH_SUFFIXES:
        raise InputError(f"{path}: not a mesh file ({', '.join(MESH_SUFFIXES)} can be read)")
    data = read_bytes(path, MOST_BYTES)
    if not data.strip():
        raise InputError(f"{path}: the file is empty")
    try:
        mesh = _read(kind, path, data)
    except Broken as error:
        raise InputError(f"{path}: damaged, or no {kind[1:].upper()} file ({error})") from None
    if not len(mesh.faces):
        what = "points but no faces: give a triangle mesh" if len(mesh.vertices) else "no geometry"
        raise InputError(f"{path}: the file holds {what}")
    return mesh


def _read(kind: str, path: Path, data: bytes) -> MeshFile:
    if kind == ".off":
        return MeshFile(*read_off(data))
    if kind == ".stl":
        return MeshFile(*read_stl(data))
    if kind == ".ply":
        vertices, faces = read_ply(path, data)
        return _with_layout(
            vertices, faces, lambda: ply_layout(path, data, ply_header(data), faces)
        )
    if kind == ".obj":
        obj = ObjFile(path, data)
        return _with_layout(*obj.geometry(), obj.layout)
    document = GltfDocument(path, data)
    parts = gltf_parts(document)
    return _with_layout(*placed_together(parts), lambda: gltf_layout(document, parts))


def _with_layout(vertices: Vertices, faces: Faces, layout: Callable[[], Layout | None]) -> MeshFile:
    """The mesh with its layout, or with a note where that cannot be read."""
    try:
        return MeshFile(vertices, faces, layout())
    except (Broken, InputError) as error:
        told = f"its texture coordinates cannot be used ({error}); a texture gets its own layout"
        return MeshFile(vertices, faces, None, (told,))
