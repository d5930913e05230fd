"""Directions around normals, spread evenly for rays."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Floats


def cosine_directions(normals: Floats, shifts: Floats, rays: int) -> Floats:
    """(m, rays, 3) unit vectors, cosine-distributed around unit `normals` (m, 3).

    Roberts' R2 sequence, turned by `shifts` (m, 2) in 0..1 (Cranley and Patterson 1976).
    """
    golden = np.array([0.7548776662466927, 0.5698402909980532])  # 1/g, 1/g^2 with g^3 = g + 1
    points = (np.arange(1, rays + 1)[:, None] * golden + 0.5).astype(np.float32)
    u = (points[None] + shifts[:, None]) % 1
    radius, angle = np.sqrt(u[..., 0]), np.float32(2 * np.pi) * u[..., 1]
    height = np.sqrt(np.maximum(1 - u[..., 0], 0))
    b1, b2 = tangents(normals)
    across = (radius * np.cos(angle))[..., None] * b1[:, None]
    along = (radius * np.sin(angle))[..., None] * b2[:, None]
    return across + along + height[..., None] * normals[:, None]


def tangents(n: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors square to each unit vector of (m, 3). Duff et al., JCGT 6(1), 2017."""
    x, y, z = n.T
    sign = np.copysign(np.float32(1), z)
    a = -1 / (sign + z)
    b = x * y * a
    b1 = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    return b1, np.stack([b, sign + y * y * a, -y], axis=1)
