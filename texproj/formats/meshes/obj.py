"""OBJ in the file's order, whatever its groups and materials.

Ours, since readers at hand split vertices at texture seams and materials, and take negative
indices as counted from the end of the file instead of from their line.
"""

from __future__ import annotations

import re
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.formats.documents import text_of
from texproj.formats.foreign import Broken
from texproj.formats.meshes.mtl import read_materials
from texproj.formats.meshes.polygons import (
    NO_FACES,
    Faces,
    Ints,
    Vertices,
    fans,
    numbers,
    positions,
)
from texproj.layout import NO_PLACE, Layout, Material, Node

_VERTEX = re.compile(rb"^[ \t]*v[ \t]+(.*)$", re.MULTILINE)
_TEXTURE = re.compile(rb"^[ \t]*vt[ \t]+(.*)$", re.MULTILINE)
_FACE = re.compile(rb"^[ \t]*f[ \t]+(.*)$", re.MULTILINE)
_KIND = re.compile(rb"^[ \t]*([vf])[ \t]", re.MULTILINE)
_TEXTURE_KIND = re.compile(rb"^[ \t]*(?:v(?=t[ \t])|(?=f[ \t]))([tf])[ \t]", re.MULTILINE)
_OTHER_INDICES = re.compile(rb"/[-\d/]*")
_WITHOUT_TEXTURE = re.compile(rb"(?<![-\d/])-?\d+(?://-?\d*|/)?(?![-\d/])")
_WITH_TEXTURE = re.compile(rb"-?\d+/(-?\d+)(?:/-?\d*)?")
_SECTION = re.compile(rb"^[ \t]*(usemtl|o|g)[ \t]+(.*)$", re.MULTILINE)
_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.*)$", re.MULTILINE)
MISSING = b"999999999"
"""In place of the number of a corner's texture vertex where it has none; no file has so many."""
LONGEST_NAME = 200


class ObjFile:
    """The text of an OBJ: its triangles, and where they lie in textures."""

    def __init__(self, path: Path, data: bytes) -> None:
        self._path = path
        self._data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")

    def geometry(self) -> tuple[Vertices, Faces]:
        """Positions and faces. Raises Broken."""
        lines = _VERTEX.findall(self._data)
        if not lines:
            raise Broken("no vertices")
        return positions(lines), self._faces()

    @cached_property
    def _polygons(self) -> list[bytes]:
        return _FACE.findall(self._data)

    @cached_property
    def _counts(self) -> Ints:
        """Corners of each polygon, once they have been read."""
        return self._indices(_OTHER_INDICES.sub(b"", self._text))[1]

    @property
    def _text(self) -> bytes:
        """All polygons. 0 is no index: it ends each."""
        return b" 0 ".join(self._polygons) + b" 0"

    def _indices(self, text: bytes) -> tuple[Ints, Ints]:
        """The indices of all polygons, and how many each has."""
        corners = numbers(text, np.int64)
        ends = np.flatnonzero(corners == 0)
        if len(ends) != len(self._polygons):
            raise Broken("a face with index 0")
        return corners[corners != 0], np.diff(ends, prepend=-1) - 1

    def _faces(self) -> Faces:
        """Polygons as fans of triangles around their first corner."""
        if not self._polygons:
            return NO_FACES
        corners, counts = self._indices(_OTHER_INDICES.sub(b"", self._text))
        return fans(self._from_start(corners, counts, _KIND, b"v") - 1, counts)

    def _from_start(
        self, corners: Ints, counts: Ints, kind: re.Pattern[bytes], word: bytes
    ) -> Ints:
        """Indices counted from the first of their kind, where some count back from their line."""
        if not (corners < 0).any():
            return corners
        kinds = np.frombuffer(b"".join(kind.findall(self._data)), "S1")
        known = np.repeat(np.cumsum(kinds == word)[kinds == b"f"], counts)
        return np.where(corners < 0, corners + known + 1, corners)

    def layout(self) -> Layout | None:
        """Where the triangles lie in textures; None where no face says so. Raises Broken."""
        lines = _TEXTURE.findall(self._data)
        if not lines or b"/" not in self._text:
            return None
        uv = _pairs(lines)
        text = _WITH_TEXTURE.sub(rb"\1", _WITHOUT_TEXTURE.sub(MISSING, _ends_kept(self._polygons)))
        corners, counts = self._indices(text)
        corners = self._from_start(corners, counts, _TEXTURE_KIND, b"t") - 1
        faces = fans(np.where((corners >= 0) & (corners < len(uv)), corners, NO_PLACE), counts)
        if not (faces >= 0).all(axis=1).any():
            return None
        material_names, materials = self._sections(b"usemtl")
        node_names, nodes = self._sections(b"o", b"g")
        triangles = np.maximum(counts - 2, 0)
        known = {m.name: m for m in read_materials(self._path, self._libraries)}
        return Layout(
            uv, faces,
            np.repeat(materials, triangles).astype(np.int32),
            np.repeat(nodes, triangles).astype(np.int32),
            tuple(known.get(name, Material(name)) for name in material_names),
            tuple(Node(name) for name in node_names),
        )  # fmt: skip

    @property
    def _libraries(self) -> list[str]:
        return [text_of(line.strip(), "mtllib") for line in _LIBRARY.findall(self._data)]

    def _sections(self, *words: bytes) -> tuple[list[str], NDArray[Any]]:
        """Names after any of the words, and for each polygon the row of the last one before it."""
        names: dict[str, int] = {}
        rows, counts, at, current = [], [], 0, NO_PLACE
        found = [m for m in _SECTION.finditer(self._data) if m[1] in words]
        if words != (b"usemtl",) and any(m[1] == b"o" for m in found):
            found = [m for m in found if m[1] == b"o"]  # groups are parts of objects
        for match in found:
            rows.append(current)
            counts.append(_polygons_in(self._data, at, match.start()))
            name = text_of(match[2].strip(), "usemtl")[:LONGEST_NAME]
            current, at = names.setdefault(name, len(names)), match.start()
        rows.append(current)
        counts.append(len(self._polygons) - sum(counts))
        of_polygon = np.repeat(rows, counts)
        if words != (b"usemtl",) and (of_polygon == NO_PLACE).any():
            of_polygon = np.where(of_polygon == NO_PLACE, len(names), of_polygon)
            names[self._path.stem] = len(names)
        return list(names), of_polygon


def _polygons_in(data: bytes, start: int, stop: int) -> int:
    return sum(1 for _ in _FACE.finditer(data, start, stop))


def _ends_kept(polygons: list[bytes]) -> bytes:
    """The polygons, each ended by a 0 that is taken for no vertex."""
    return b" 0/0 ".join(polygons) + b" 0/0"


def _pairs(lines: list[bytes]) -> NDArray[np.float64]:
    """(n, 2) u v of lines that may go on. Raises Broken."""
    try:
        uv = np.array([(*line.split()[:2], b"0")[:2] for line in lines], np.float64)
    except ValueError:
        raise Broken("a word where a texture coordinate should be") from None
    if not np.isfinite(uv).all():
        raise Broken("texture coordinates that are no numbers")
    return uv.reshape(-1, 2)
