"""Factors on each photo's linear light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats


@dataclass(frozen=True, eq=False)
class Gains:
    """Factors on linear light that make the photos agree.

    factor: (p, 3) float32 per photo and channel, with the light of corrected lenses 1 in the
    geometric mean over what the photos show; spread: (p,) median absolute log difference to the
    others after correction; points: (p,) points that the photo shares with another one, of those
    that were compared.
    """

    factor: Floats
    spread: Floats
    points: NDArray[np.int64]


def no_gains(photos: int) -> Gains:
    """Every photo as it is."""
    return Gains(
        np.ones((photos, 3), np.float32), np.zeros(photos, np.float32), np.zeros(photos, np.int64)
    )
