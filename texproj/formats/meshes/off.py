"""OFF in all its kinds (with colors, normals, texture coordinates), text only.

Ours, since the regular expressions of readers at hand run for ever on some headers.
"""

from __future__ import annotations

import re

from texproj.formats.foreign import Broken
from texproj.formats.meshes.polygons import Faces, Vertices, counted_polygons, positions

_HEADER = re.compile(rb"(?:ST)?C?N?4?n?OFF\b")
LONGEST_COUNT = 10
"""Digits of a number of vertices or faces."""


def read_off(data: bytes) -> tuple[Vertices, Faces]:
    """Positions and faces of an OFF. Raises Broken, also where fewer lines follow than told."""
    lines = [line for raw in data.splitlines() if (line := raw.split(b"#", 1)[0].strip())]
    header = _HEADER.match(lines[0]) if lines else None
    if header is None:
        raise Broken("it does not begin with OFF")
    if b"BINARY" in lines[0]:
        raise Broken("binary OFF; export it as text, or as ply")
    rest = lines[0][header.end() :].strip()
    lines = [rest, *lines[1:]] if rest else lines[1:]
    counts = lines[0].split() if lines else []
    if len(counts) < 2 or not all(c.isdigit() and len(c) <= LONGEST_COUNT for c in counts[:2]):
        raise Broken("no numbers of vertices and faces")
    vertex_count, face_count = int(counts[0]), int(counts[1])
    if len(lines) < 1 + vertex_count + face_count:
        raise Broken(f"{len(lines) - 1} lines of {vertex_count + face_count}: it was cut off")
    body = lines[1 : 1 + vertex_count + face_count]
    return positions(body[:vertex_count]), counted_polygons(body[vertex_count:])
