"""Reading meshes: geometry only, in the file's own frame, units, precision and order."""

from __future__ import annotations

import io
import logging
import re
import struct
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError

Vertices = NDArray[np.float64]
Faces = NDArray[np.int32]

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")

_OBJ_VERTEX = re.compile(rb"^[ \t]*v[ \t]+(.*)$", re.MULTILINE)
_OBJ_FACE = re.compile(rb"^[ \t]*f[ \t]+(.*)$", re.MULTILINE)
_OBJ_KIND = re.compile(rb"^[ \t]*([vf])[ \t]", re.MULTILINE)
# what the reader of glTF does not decode
_COMPRESSIONS = (b"KHR_draco_mesh_compression", b"EXT_meshopt_compression")
_OFF_COUNTS = re.compile(rb"OFF\s+(?:#.*\s+)*\d+\s+(\d+)")
_OBJ_OTHER_INDICES = re.compile(rb"/[-\d/]*")


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
    """By the first of our parsers that finds triangles, else what it found."""
    parsers: list[Callable[[], tuple[Vertices, Faces]]]
    if kind == ".obj":
        parsers = [lambda: _obj(data)]
    elif kind == ".ply":  # the first is fast, the last knows mixed polygons and triangle strips
        parsers = [lambda: _by_trimesh(path, kind, data), lambda: _by_pymeshlab(path)]
        if b"\nformat binary" in data[:100]:
            parsers.insert(0, lambda: _by_plyfile(path))
    else:
        parsers = [lambda: _by_trimesh(path, kind, data)]
    reason, found = "", None
    for parser in parsers:
        try:
            vertices, faces = parser()
        except _PARSER_ERRORS as error:
            reason = reason or " ".join(str(error).split())[:100] or type(error).__name__
        else:
            if len(faces):
                return vertices, faces
            found = found or (vertices, faces)
    if found is None:
        raise InputError(f"{path}: damaged, or no {kind[1:].upper()} file ({reason})")
    return found


_PARSER_ERRORS = (
    ValueError, KeyError, IndexError, TypeError, AttributeError, ArithmeticError, MemoryError,
    NotImplementedError, OSError, ImportError, RuntimeError, EOFError, DeprecationWarning,
    AssertionError, NameError, struct.error,
)  # fmt: skip
"""What parsers of other hands raise on broken input."""


def _by_plyfile(path: Path) -> tuple[Vertices, Faces]:
    """A binary ply of triangles, straight from the disk. Raises if it holds other polygons."""
    import plyfile  # noqa: PLC0415

    corners = {"vertex_indices": 3, "vertex_index": 3}
    known = {"face": corners | {"texcoord": 6}}
    try:
        ply = plyfile.PlyData.read(path, mmap="r", known_list_len=known)
    except plyfile.PlyParseError as error:
        raise ValueError(str(error)) from None
    vertex, face = ply["vertex"].data, ply["face"].data
    names = [name for name in corners if name in face.dtype.names]
    vertices = np.stack([vertex[axis] for axis in "xyz"], axis=1).astype(np.float64)
    return vertices, _int32(face[names[0]].reshape(-1, 3))


def _by_trimesh(path: Path, kind: str, data: bytes) -> tuple[Vertices, Faces]:
    import trimesh  # noqa: PLC0415 - half a second, only where a mesh is read

    logging.getLogger("trimesh").addHandler(logging.NullHandler())  # else it prints tracebacks
    options: dict[str, Any] = {"process": False, "file_type": kind[1:]}
    if kind == ".ply":  # else vertices are split and renumbered where texture seams run
        options |= {"fix_texture": False, "skip_materials": True}
    if kind == ".stl":
        data = _stl(data)
    if kind == ".off":
        data = data.decode("latin-1").encode()  # comments of any encoding
    for name in _COMPRESSIONS:
        if kind in (".glb", ".gltf") and name in data:
            raise InputError(f"{path}: compressed by {name.decode()}; export it uncompressed")
    if kind == ".gltf":
        options["resolver"] = trimesh.resolvers.FilePathResolver(str(path))
    with np.errstate(invalid="ignore"):  # NaNs are left to the repair
        vertices, faces = _merged(trimesh.load_scene(io.BytesIO(data), **options))
    if kind == ".off" and (counts := _OFF_COUNTS.search(data)) and len(faces) < int(counts[1]):
        raise ValueError(f"{len(faces)} of {int(counts[1])} faces: the file was cut off")
    return vertices, faces


def _stl(data: bytes) -> bytes:
    """Binary STL without what some programs append, ASCII STL with names of any encoding."""
    size = 84 + 50 * int.from_bytes(data[80:84], "little")  # in a text this is astronomical
    return data[:size] if 84 < size <= len(data) else data.decode("latin-1").encode()


def _merged(scene: Any) -> tuple[Vertices, Faces]:
    """All triangles of a scene in one frame; points only count as vertices."""
    vertices, faces, offset = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for node in scene.graph.nodes_geometry:
        world_from_part, name = scene.graph[node]
        part = scene.geometry[name]
        xyz = np.asarray(part.vertices, np.float64)
        if not np.array_equal(world_from_part, np.eye(4)):
            xyz = xyz @ world_from_part[:3, :3].T + world_from_part[:3, 3]
        corners = np.asarray(getattr(part, "faces", faces[0]))
        if np.linalg.det(world_from_part[:3, :3]) < 0:
            corners = corners[:, ::-1]  # a mirror turns triangles around
        vertices.append(xyz)
        faces.append(corners + offset)
        offset += len(xyz)
    return np.concatenate(vertices), _int32(np.concatenate(faces))


_PYMESHLAB = """
import sys, numpy, pymeshlab
meshes = pymeshlab.MeshSet()
meshes.load_new_mesh(sys.argv[1])
mesh = meshes.current_mesh()
numpy.savez(sys.argv[2], vertices=mesh.vertex_matrix(), faces=mesh.face_matrix())
"""


def _by_pymeshlab(path: Path) -> tuple[Vertices, Faces]:
    """In a process of its own: on broken files its reader can end the process it runs in."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder, "mesh.npz")
        command = [sys.executable, "-c", _PYMESHLAB, str(path), str(result)]
        done = subprocess.run(command, capture_output=True, check=False)
        if done.returncode:
            raise ValueError("MeshLab cannot read it either")
        with np.load(result) as arrays:
            return arrays["vertices"], _int32(arrays["faces"])


def _int32(indices: NDArray[Any]) -> Faces:
    """Indices that do not fit stay out of range."""
    return np.clip(indices, -1, np.iinfo(np.int32).max).astype(np.int32)


def _obj(data: bytes) -> tuple[Vertices, Faces]:
    """Positions and faces of an OBJ in the file's order, whatever its groups and materials.

    Ours, since readers at hand split vertices at texture seams and materials, and take negative
    indices as counted from the end of the file instead of from their line.
    """
    data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    lines = _OBJ_VERTEX.findall(data)
    polygons = _OBJ_FACE.findall(data)
    if not lines:
        raise ValueError("no vertices")
    return _obj_positions(lines), _obj_faces(data, polygons)


def _obj_positions(lines: list[bytes]) -> Vertices:
    """x y z of lines that may go on with a weight or a color."""
    columns = len(lines[0].split())
    values = _numbers(b"\n".join(lines), np.float64)
    if columns < 3 or len(values) != columns * len(lines):
        return np.array([line.split()[:3] for line in lines], np.float64)
    return np.ascontiguousarray(values.reshape(-1, columns)[:, :3])


def _obj_faces(data: bytes, polygons: list[bytes]) -> Faces:
    """Polygons as fans of triangles around their first corner."""
    if not polygons:
        return np.zeros((0, 3), np.int32)
    # 0 is no index: it ends each polygon
    text = _OBJ_OTHER_INDICES.sub(b"", b" 0 ".join(polygons) + b" 0")
    corners = _numbers(text, np.int64)
    ends = np.flatnonzero(corners == 0)
    if len(ends) != len(polygons):
        raise ValueError("a face with index 0")
    starts = np.concatenate([[0], ends[:-1] + 1])
    counts = np.maximum(ends - starts - 2, 0)
    polygon = np.repeat(np.arange(len(starts)), counts)
    nth = np.arange(len(polygon)) - np.repeat(np.cumsum(counts) - counts, counts)
    first = starts[polygon]
    faces = corners[np.stack([first, first + nth + 1, first + nth + 2], axis=1)]
    if (faces < 0).any():
        kinds = np.frombuffer(b"".join(_OBJ_KIND.findall(data)), "S1")
        known = np.cumsum(kinds == b"v")[kinds == b"f"][polygon]
        faces = np.where(faces < 0, faces + known[:, None] + 1, faces)
    return _int32(faces - 1)


def _numbers(text: bytes, dtype: type[np.generic]) -> NDArray[Any]:
    """All white-space separated numbers. Raises DeprecationWarning or ValueError for others."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
        return np.fromstring(text, dtype, sep=" ")
