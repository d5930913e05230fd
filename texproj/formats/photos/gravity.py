"""Which way is up in a photo, where the camera has measured it: XMP of gimbals."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, Protocol

XMP = 700
"""TIFF's tag of the XMP block; that of a JPEG is put under the same number."""
LONGEST_XMP = 1 << 20
LARGEST_DEG = 360
"""A gimbal's angle beyond it is none."""
ANGLE = re.compile(
    rb"""drone-dji:Gimbal(Pitch|Roll)Degree\s*(?:=\s*["']|>)\s*([+-]?\d{1,3}(?:\.\d{1,9})?)\s*["'<]"""
)
"""DJI's angles as attribute or as element, degrees in its north-east-down frame: pitch above the
horizon, roll clockwise. Those of others are left alone: they count from elsewhere, and do not say
from where."""
TURNS = {
    1: (1, 0, 0, 1), 2: (-1, 0, 0, 1), 3: (-1, 0, 0, -1), 4: (1, 0, 0, -1), 5: (0, 1, 1, 0),
    6: (0, -1, 1, 0), 7: (0, -1, -1, 0), 8: (0, 1, -1, 0),
}  # fmt: skip
"""By EXIF orientation, the matrix (row by row) from directions in the stored picture to those in
the upright one."""


class Held(Protocol):
    """A picture's header."""

    @property
    def tags(self) -> Mapping[int, Any]: ...

    @property
    def orientation(self) -> int: ...


def up_of(header: Held) -> tuple[float, float, float] | tuple[()]:
    """Unit vector upward in the axes of the upright picture's camera (x right, y down, z forward);
    empty where nothing tells.
    """
    block = header.tags.get(XMP)
    if not isinstance(block, bytes) or len(block) > LONGEST_XMP:
        return ()
    degrees = {name: float(value) for name, value in ANGLE.findall(block)}
    angle = {name: math.radians(value) for name, value in degrees.items()}
    if b"Pitch" not in angle or max(map(abs, degrees.values())) > LARGEST_DEG:
        return ()
    pitch, roll = angle[b"Pitch"], angle.get(b"Roll", 0.0)
    x, y = -math.sin(roll) * math.cos(pitch), -math.cos(roll) * math.cos(pitch)
    a, b, c, d = TURNS[header.orientation]
    return a * x + b * y, c * x + d * y, math.sin(pitch)
