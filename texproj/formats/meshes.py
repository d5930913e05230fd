"""Reading meshes: geometry only, in the file's own frame, units, precision and order."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError

Vertices = NDArray[np.float64]
Faces = NDArray[np.int32]

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")

_OBJ_OTHER = re.compile(rb"^(?![vf][ \t]).*$\n?", re.MULTILINE)
_OBJ_INDEX = re.compile(rb"/[-\d/]*")


def read_mesh(path: Path) -> tuple[Vertices, Faces]:
    """((V, 3) float64 vertices, (F, 3) int32 triangles) of a ply, obj, stl, off, glb or gltf file.

    As the file has them: nothing is welded or dropped, doubles stay doubles, polygons become
    triangles, the parts of a scene are placed by their transforms and put one after the other.
    Raises InputError for a file that is missing, broken, of another kind or without triangles.
    """
    kind = path.suffix.lower()
    if kind not in MESH_SUFFIXES:
        raise InputError(f"{path}: not a mesh file ({', '.join(MESH_SUFFIXES)} can be read)")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    if not data.strip():
        raise InputError(f"{path}: the file is empty")
    vertices, faces = _parsed(path, kind, data)
    if not len(faces):
        what = "points but no faces: give a triangle mesh" if len(vertices) else "no geometry"
        raise InputError(f"{path}: the file holds {what}")
    return vertices, faces


def _parsed(path: Path, kind: str, data: bytes) -> tuple[Vertices, Faces]:
    attempts: list[Callable[[], tuple[Vertices, Faces]]] = [
        lambda: _by_trimesh(path, kind, data),
        lambda: _by_pymeshlab(path),
    ]
    reason = ""
    for attempt in attempts:
        try:
            return attempt()
        except _PARSER_ERRORS as error:
            reason = reason or " ".join(str(error).split())[:100]
    raise InputError(f"{path}: broken or not a {kind[1:]} file ({reason})")


_PARSER_ERRORS = (
    ValueError, KeyError, IndexError, TypeError, AttributeError, ArithmeticError,
    NotImplementedError, OSError, ImportError, RuntimeError, EOFError,
)  # fmt: skip
"""What parsers of other hands raise on broken input."""


def _by_trimesh(path: Path, kind: str, data: bytes) -> tuple[Vertices, Faces]:
    import trimesh  # noqa: PLC0415 - half a second, only where a mesh is read

    options: dict[str, Any] = {"process": False, "file_type": kind[1:]}
    if kind == ".obj":
        # without texture coordinates and materials the file's vertex order stays
        data = _OBJ_INDEX.sub(b"", _OBJ_OTHER.sub(b"", data))
    if kind == ".ply":
        options |= {"fix_texture": False, "skip_materials": True}
    if kind == ".gltf":
        options["resolver"] = trimesh.resolvers.FilePathResolver(str(path))
    scene = trimesh.load_scene(io.BytesIO(data), **options)
    return _merged(scene)


def _merged(scene: Any) -> tuple[Vertices, Faces]:
    """All triangles of a scene in one frame; points only count as vertices."""
    vertices, faces, offset = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for node in scene.graph.nodes_geometry:
        world_from_part, name = scene.graph[node]
        part = scene.geometry[name]
        xyz = np.asarray(part.vertices, np.float64)
        if not np.array_equal(world_from_part, np.eye(4)):
            xyz = xyz @ world_from_part[:3, :3].T + world_from_part[:3, 3]
        vertices.append(xyz)
        faces.append(np.asarray(getattr(part, "faces", faces[0])) + offset)
        offset += len(xyz)
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32)


def _by_pymeshlab(path: Path) -> tuple[Vertices, Faces]:
    import pymeshlab  # noqa: PLC0415 - needs GL libraries that may be missing

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int32)
