"""OBJ in the file's order, whatever its groups and materials.

Ours, since readers at hand split vertices at texture seams and materials, and take negative
indices as counted from the end of the file instead of from their line.
"""

from __future__ import annotations

import re

import numpy as np

from texproj.formats.foreign import Broken
from texproj.formats.meshes.polygons import NO_FACES, Faces, Vertices, fans, numbers, positions

_VERTEX = re.compile(rb"^[ \t]*v[ \t]+(.*)$", re.MULTILINE)
_FACE = re.compile(rb"^[ \t]*f[ \t]+(.*)$", re.MULTILINE)
_KIND = re.compile(rb"^[ \t]*([vf])[ \t]", re.MULTILINE)
_OTHER_INDICES = re.compile(rb"/[-\d/]*")


def read_obj(data: bytes) -> tuple[Vertices, Faces]:
    """Positions and faces of an OBJ. Raises Broken."""
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")
    lines = _VERTEX.findall(data)
    if not lines:
        raise Broken("no vertices")
    return positions(lines), _faces(data, _FACE.findall(data))


def _faces(data: bytes, polygons: list[bytes]) -> Faces:
    """Polygons as fans of triangles around their first corner."""
    if not polygons:
        return NO_FACES
    # 0 is no index: it ends each polygon
    text = _OTHER_INDICES.sub(b"", b" 0 ".join(polygons) + b" 0")
    corners = numbers(text, np.int64)
    ends = np.flatnonzero(corners == 0)
    if len(ends) != len(polygons):
        raise Broken("a face with index 0")
    counts = np.diff(ends, prepend=-1) - 1
    corners = corners[corners != 0]
    if (corners < 0).any():
        kinds = np.frombuffer(b"".join(_KIND.findall(data)), "S1")
        known = np.repeat(np.cumsum(kinds == b"v")[kinds == b"f"], counts)
        corners = np.where(corners < 0, corners + known + 1, corners)
    return fans(corners - 1, counts)
