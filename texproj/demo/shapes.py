"""Signed distances of simple solids (negative inside) and ways to join and carve them.

All take (n, 3) float32 points and give (n,) float32 distances, exact or a lower bound of the
exact one near the surface. Formulas: the usual ones of distance-field modelling (I. Quilez,
"Distance functions"), written anew.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from texproj.arrays import Floats

Field = Callable[[Floats], Floats]


def box(xyz: Floats, center: ArrayLike, half: ArrayLike, round_by: float = 0.0) -> Floats:
    """A box with edges rounded by a radius."""
    c, h = np.asarray(center, np.float32), np.asarray(half, np.float32) - np.float32(round_by)
    x, y, z = (np.abs(xyz[:, k] - c[k]) - h[k] for k in range(3))
    inside = np.minimum(np.maximum(np.maximum(x, y), z), 0)
    outside = np.maximum(x, 0) ** 2 + np.maximum(y, 0) ** 2 + np.maximum(z, 0) ** 2
    return np.sqrt(outside) + inside - np.float32(round_by)


def sphere(xyz: Floats, center: ArrayLike, radius: float) -> Floats:
    """A ball."""
    c = np.asarray(center, np.float32)
    x, y, z = (xyz[:, k] - c[k] for k in range(3))
    return np.sqrt(x * x + y * y + z * z) - np.float32(radius)


def capsule(xyz: Floats, start: ArrayLike, end: ArrayLike, radius: float) -> Floats:
    """All points closer than a radius to the line between two points."""
    a, b = np.asarray(start, np.float32), np.asarray(end, np.float32)
    along = b - a
    t = np.clip((xyz - a) @ along / np.float32(along @ along), 0, 1)
    x, y, z = (xyz[:, k] - a[k] - t * along[k] for k in range(3))
    return np.sqrt(x * x + y * y + z * z) - np.float32(radius)


def extruded(profile: Floats, along: Floats, half: float) -> Floats:
    """A plane figure given by its distances, extruded to +-half along the third axis."""
    other = np.abs(along) - np.float32(half)
    outside = np.hypot(np.maximum(profile, 0), np.maximum(other, 0))
    return outside + np.minimum(np.maximum(profile, other), 0)


def turned(radius: Floats, height: Floats, profile: ArrayLike) -> Floats:
    """A solid of revolution: profile is (k, 2) of height and radius, joined by lines.

    radius: (n,) distance from the axis; height: (n,) along it. The slope of the profile
    shortens the distance, so that the value stays a lower bound.
    """
    table = np.asarray(profile, float)
    wanted = np.interp(height, table[:, 0], table[:, 1]).astype(np.float32)
    ends = np.maximum(table[0, 0] - height, height - table[-1, 0])
    return np.maximum((radius - wanted) * np.float32(0.7), ends).astype(np.float32)


def join(a: Floats, b: Floats, blend: float = 0.0) -> Floats:
    """Union; the seam is filled over the distance `blend`."""
    if not blend:
        return np.minimum(a, b)
    overlap = np.maximum(blend - np.abs(a - b), 0) / blend
    return np.minimum(a, b) - overlap**2 * np.float32(blend / 4)


def carve(a: Floats, tool: Floats, blend: float = 0.0) -> Floats:
    """What is left of `a` after cutting `tool` away; the cut's edge is worn over `blend`."""
    return -join(-a, tool, blend)
