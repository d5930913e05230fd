"""What trimesh reads for us: STL of both kinds, and binary PLY of any polygons."""

from __future__ import annotations

import io
import logging
from typing import Any

import numpy as np

from texproj.formats.foreign import foreign_parser
from texproj.formats.meshes.polygons import NO_FACES, Faces, Vertices, int32


def read_scene(kind: str, data: bytes) -> tuple[Vertices, Faces]:
    """All triangles of a file without transforms, its vertices in its order. Raises Broken."""
    import trimesh  # noqa: PLC0415 - half a second, only where a mesh is read

    logging.getLogger("trimesh").addHandler(logging.NullHandler())  # else it prints tracebacks
    options: dict[str, Any] = {"process": False, "file_type": kind}
    if kind == "ply":  # else vertices are split and renumbered where texture seams run
        options |= {"fix_texture": False, "skip_materials": True}
    vertices, faces, offset = [np.zeros((0, 3))], [NO_FACES], 0
    with foreign_parser(), np.errstate(invalid="ignore"):  # NaNs are left to the repair
        scene = trimesh.load_scene(io.BytesIO(data), **options)
        for part in scene.geometry.values():
            vertices.append(np.asarray(part.vertices, np.float64).reshape(-1, 3))
            faces.append(int32(np.asarray(getattr(part, "faces", NO_FACES)) + offset))
            offset += len(vertices[-1])
    return np.concatenate(vertices), np.concatenate(faces)


def read_stl(data: bytes) -> tuple[Vertices, Faces]:
    """Binary STL without what some programs append, ASCII STL with names of any encoding."""
    size = 84 + 50 * int.from_bytes(data[80:84], "little")  # in a text this is astronomical
    binary = 84 < size <= len(data)
    return read_scene("stl", data[:size] if binary else data.decode("latin-1").encode())
