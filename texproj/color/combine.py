"""Many photos' colors of a point to one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.color.points import Floats
from texproj.color.spill import Stack
from texproj.color.view import WHITE


@dataclass(frozen=True, eq=False)
class Blend:
    """One color per point.

    rgb: (n, 3) float32 linear light, 0 where unseen; weight: (n,) float32 sum of the weights,
    0 = unseen; photo_count: (n,) uint16.
    """

    rgb: Floats
    weight: Floats
    photo_count: NDArray[np.uint16]


def weighted_mean(stack: Stack) -> Blend:
    """The mean of the photos' colors by their weights."""
    weight = stack.weight.sum(axis=0)
    total = np.einsum("pn,pnc->nc", stack.weight, stack.rgb, dtype=np.float32, casting="unsafe")
    rgb = total / np.maximum(weight, np.float32(1e-12))[:, None] * np.float32(1 / WHITE)
    return Blend(rgb, weight, np.count_nonzero(stack.weight, axis=0).astype(np.uint16))
