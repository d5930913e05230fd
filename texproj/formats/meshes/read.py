"""A mesh file of any kind to vertices and triangles, and what its reader has to say about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from texproj.errors import InputError
from texproj.formats.documents import read_bytes
from texproj.formats.foreign import Broken
from texproj.formats.meshes.gltf import has_texture_coordinates, read_gltf
from texproj.formats.meshes.obj import read_obj
from texproj.formats.meshes.off import read_off
from texproj.formats.meshes.ply import ply_header, read_ply
from texproj.formats.meshes.polygons import Faces, Vertices
from texproj.formats.meshes.scene import read_stl

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")

MOST_BYTES = 32 << 30
"""The file is read whole; 300 million faces take less."""

TEXTURED = (
    "it brings its own texture coordinates: they and its textures are not used; colors come from"
    " the photos alone, and a texture gets a layout of its own"
)


@dataclass(frozen=True, eq=False)
class MeshFile:
    """What a mesh file holds: (V, 3) float64 vertices, (F, 3) int32 triangles, both as the file
    has them, and notes: what of it is not used, one sentence each.
    """

    vertices: Vertices
    faces: Faces
    notes: tuple[str, ...] = ()


def read_mesh(path: Path) -> tuple[Vertices, Faces]:
    """Vertices and triangles alone. Raises InputError; see `read_mesh_file`."""
    mesh = read_mesh_file(path)
    return mesh.vertices, mesh.faces


def read_mesh_file(path: Path) -> MeshFile:
    """The geometry of a ply, obj, stl, off, glb or gltf file.

    As the file has it: nothing is welded or dropped, doubles stay doubles, polygons become
    triangles, the parts of a scene are placed by their transforms and put one after the other.
    Raises InputError for a file that is missing, broken, of another kind or without triangles.
    """
    kind = path.suffix.lower()
    if kind not in MESH_SUFFIXES:
        raise InputError(f"{path}: not a mesh file ({', '.join(MESH_SUFFIXES)} can be read)")
    data = read_bytes(path, MOST_BYTES)
    if not data.strip():
        raise InputError(f"{path}: the file is empty")
    try:
        vertices, faces = _reader(kind)(path, data)
        textured = _brings_texture(kind, data)
    except Broken as error:
        raise InputError(f"{path}: damaged, or no {kind[1:].upper()} file ({error})") from None
    if not len(faces):
        what = "points but no faces: give a triangle mesh" if len(vertices) else "no geometry"
        raise InputError(f"{path}: the file holds {what}")
    return MeshFile(vertices, faces, (TEXTURED,) if textured else ())


def _reader(kind: str) -> Callable[[Path, bytes], tuple[Vertices, Faces]]:
    readers: dict[str, Callable[[Path, bytes], tuple[Vertices, Faces]]] = {
        ".obj": lambda path, data: read_obj(data),
        ".off": lambda path, data: read_off(data),
        ".stl": lambda path, data: read_stl(data),
        ".ply": read_ply,
    }
    return readers.get(kind, read_gltf)


def _brings_texture(kind: str, data: bytes) -> bool:
    if kind == ".obj":
        return b"\nvt " in data
    if kind == ".ply":
        return ply_header(data).textured
    return kind in (".glb", ".gltf") and has_texture_coordinates(data)
