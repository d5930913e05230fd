"""PLY: text by ourselves, triangles in binary by plyfile, other polygons by trimesh or MeshLab."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texproj.errors import excerpt
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.meshes.polygons import (
    NO_FACES,
    Faces,
    Vertices,
    counted_polygons,
    int32,
    positions,
)
from texproj.formats.meshes.scene import read_scene

LONGEST_HEADER = 100_000
CORNERS = ("vertex_indices", "vertex_index")
TEXCOORD = "texcoord"
"""Texture coordinates at the corners of a face, u v u v ..."""


@dataclass(frozen=True)
class Element:
    """An element of the header: its name, how many of it follow, its properties (name, list?)."""

    name: str
    count: int
    properties: tuple[tuple[str, bool], ...]


@dataclass(frozen=True)
class Header:
    """The header of a PLY. kind: ascii, binary_little_endian, binary_big_endian; size: bytes;
    comments: what stands in them, of any kind.
    """

    kind: str
    elements: tuple[Element, ...]
    size: int
    comments: tuple[str, ...]

    def element(self, name: str) -> Element:
        found = [e for e in self.elements if e.name == name]
        return found[0] if found else Element(name, 0, ())


def read_ply(path: Path, data: bytes) -> tuple[Vertices, Faces]:
    """Positions and faces of a PLY. Raises Broken."""
    header = ply_header(data)
    if header.kind == "ascii":
        if any(e.name == "tristrips" and e.count for e in header.elements):
            return _by_meshlab(path)
        return _text(data, header)
    if not header.element("face").count and not header.element("tristrips").count:
        return read_scene("ply", data)
    parsers: list[Callable[[], tuple[Vertices, Faces]]]
    parsers = [lambda: _triangles(path), lambda: read_scene("ply", data), lambda: _by_meshlab(path)]
    reason = ""
    for parser in parsers:
        try:
            vertices, faces = parser()
        except Broken as error:
            reason = reason or str(error)
        else:
            if len(faces):
                return vertices, faces
    raise Broken(reason or "no face can be read")


def ply_header(data: bytes) -> Header:
    """What the header of a PLY tells. Raises Broken."""
    end = data.find(b"end_header", 0, LONGEST_HEADER)
    line_end = data.find(b"\n", end, end + 20) if b"\n" in data[:end] else data.find(b"\r", end)
    if data[:3] != b"ply" or end < 0 or line_end < 0:
        raise Broken("no header of a PLY")
    kind, elements = "", []
    lines = data[:end].decode("latin-1").splitlines()
    for words in (line.split() for line in lines):
        if words[:1] == ["format"] and len(words) > 1:
            kind = words[1]
        elif words[:1] == ["element"]:
            elements.append(_element(words))
        elif words[:1] == ["property"] and elements and len(words) > 2:
            last = elements[-1]
            added = (*last.properties, (words[-1], words[1] == "list"))
            elements[-1] = Element(last.name, last.count, added)
    comments = tuple(line for line in lines if line.split()[:1] == ["comment"])
    return Header(kind, tuple(elements), line_end + 1, comments)


def _element(words: list[str]) -> Element:
    if len(words) != 3 or not words[2].isascii() or not words[2].isdigit() or len(words[2]) > 10:
        raise Broken(f"an element without a number: {excerpt(' '.join(words), 40)}")
    return Element(words[1], int(words[2]), ())


def text_rows(data: bytes, header: Header) -> dict[str, list[bytes]]:
    """The lines of each element of a text, by its name. Raises Broken where some are missing."""
    lines = [line for line in data[header.size :].splitlines() if line.strip()]
    told = sum(element.count for element in header.elements)
    if len(lines) < told:
        raise Broken(f"{len(lines)} lines of {told}: it was cut off")
    rows, at = {}, 0
    for element in header.elements:
        rows[element.name] = lines[at : at + element.count]
        at += element.count
    return rows


def _text(data: bytes, header: Header) -> tuple[Vertices, Faces]:
    """Every element is one line. Raises Broken where lines are missing or too short."""
    rows, vertices, faces = text_rows(data, header), np.zeros((0, 3)), NO_FACES
    if "vertex" in rows:
        vertices = _vertices(rows["vertex"], header.element("vertex"))
    if "face" in rows:
        faces = _faces(rows["face"], header.element("face"))
    return vertices, faces


def _vertices(lines: list[bytes], element: Element) -> Vertices:
    names = [name for name, _ in element.properties]
    if not {"x", "y", "z"} <= set(names):
        raise Broken("its vertices have no x, y, z")
    for i, line in enumerate(lines):
        if len(line.split()) < len(names):
            raise Broken(f"vertex {i + 1} has {len(line.split())} numbers of {len(names)}")
    columns = [names.index(axis) for axis in "xyz"]
    if columns == [0, 1, 2]:
        return positions(lines)
    return positions([b" ".join(line.split()[c] for c in columns) for line in lines])


def _faces(lines: list[bytes], element: Element) -> Faces:
    lists = [i for i, (_, is_list) in enumerate(element.properties) if is_list]
    if not lists or element.properties[lists[0]][0] not in CORNERS:
        raise Broken("its faces have no vertex_indices")
    skipped = lists[0]
    if skipped:
        lines = [b" ".join(line.split()[skipped:]) for line in lines]
    return counted_polygons(lines)


def binary_rows(path: Path) -> Any:
    """The elements of a binary file whose faces are triangles, straight from the disk. Raises
    Broken for other polygons.
    """
    import plyfile  # noqa: PLC0415

    known = {"face": dict.fromkeys(CORNERS, 3) | {TEXCOORD: 6}}
    with foreign_parser():
        return plyfile.PlyData.read(path, mmap="r", known_list_len=known)


def _triangles(path: Path) -> tuple[Vertices, Faces]:
    ply = binary_rows(path)
    with foreign_parser():
        vertex, face = ply["vertex"].data, ply["face"].data
        names = [name for name in CORNERS if name in face.dtype.names]
        vertices = np.stack([vertex[axis] for axis in "xyz"], axis=1).astype(np.float64)
        return vertices, int32(face[names[0]].reshape(-1, 3))


_MESHLAB = """
import sys, numpy, pymeshlab
meshes = pymeshlab.MeshSet()
meshes.load_new_mesh(sys.argv[1])
mesh = meshes.current_mesh()
numpy.savez(sys.argv[2], vertices=mesh.vertex_matrix(), faces=mesh.face_matrix())
"""
MESHLAB_SECONDS = 600


def _by_meshlab(path: Path) -> tuple[Vertices, Faces]:
    """In a process of its own: on broken files its reader can end the process it runs in."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder, "mesh.npz")
        command = [sys.executable, "-c", _MESHLAB, str(path.resolve()), str(result)]
        try:
            done = subprocess.run(
                command, capture_output=True, check=False, timeout=MESHLAB_SECONDS
            )
        except subprocess.TimeoutExpired:
            raise Broken(f"MeshLab did not read it in {MESHLAB_SECONDS} s") from None
        if done.returncode:
            raise Broken("MeshLab cannot read it either")
        with np.load(result) as arrays:
            return arrays["vertices"], int32(arrays["faces"])
