"""Rotations spread evenly over all there are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles

PSI = 1.533751168755204288118041
"""The real root of psi^4 = psi + 4."""


def spread_rotations(count: int) -> Doubles:
    """(count, 3, 3) rotations.

    Source: Alexa, "Super-Fibonacci Spirals: Fast, Low-Discrepancy Sampling of SO(3)", CVPR 2022,
    algorithm 1.
    """
    s = np.arange(count) + 0.5
    near, far = np.sqrt(s / count), np.sqrt(1 - s / count)
    alpha, beta = 2 * np.pi * s / np.sqrt(2), 2 * np.pi * s / PSI
    return matrices(
        np.stack(
            [near * np.sin(alpha), near * np.cos(alpha), far * np.sin(beta), far * np.cos(beta)], 1
        )
    )


def matrices(quaternions: Doubles) -> Doubles:
    """(n, 3, 3) rotation matrices of (n, 4) unit quaternions x, y, z, w."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def exponentials(vectors: NDArray[np.floating]) -> NDArray[np.floating]:
    """(n, 3, 3) rotations by (n, 3) rotation vectors, rad (Rodrigues' formula)."""
    angle = np.linalg.norm(vectors, axis=1)
    axis = vectors / np.maximum(angle, 1e-12)[:, None]
    x, y, z = axis.T
    zero = np.zeros_like(x)
    cross = np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), 2, 0)
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3, dtype=vectors.dtype) + sine * cross + (1 - cosine) * (cross @ cross)
