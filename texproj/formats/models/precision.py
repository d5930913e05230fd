"""Whether single precision is enough for coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SINGLE_TOLERANCE = 1e-7
"""Displacement over the diagonal of the bounding box: single precision around the origin."""


def single_is_enough(vertices: NDArray[np.float64]) -> bool:
    """Whether rounding (V, 3) coordinates to float32 moves none by more than SINGLE_TOLERANCE.

    Non-finite coordinates are left out. Not so for surveyed coordinates of 10^6.
    """
    finite = vertices[np.isfinite(vertices).all(axis=1)]
    if not len(finite):
        return True
    moved = np.abs(finite - finite.astype(np.float32)).max()
    return bool(moved <= SINGLE_TOLERANCE * np.linalg.norm(np.ptp(finite, axis=0)))
