"""Many photos' colors of a point to one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.color.points import Floats
from texproj.color.spill import Stack
from texproj.options import ColorOptions

BLOCK = 1 << 13
"""Points whose samples from several photos fit the processor's cache."""


@dataclass(frozen=True, eq=False)
class Blend:
    """One color per point.

    rgb: (n, 3) float32 linear light, 0 where unseen; weight: (n,) float32 sum of the weights,
    0 = unseen; photo_count: (n,) uint16; share: (p,) sum of each photo's part of the colors.
    """

    rgb: Floats
    weight: Floats
    photo_count: NDArray[np.uint16]
    share: NDArray[np.float64]


def blend(stack: Stack, gain: Floats, options: ColorOptions) -> Blend:
    """The robust weighted mean of the photos' colors times their gains.

    gain: (photos in all, 3). With `robust_rounds` 0 the plain weighted mean.
    """
    n = stack.weight.shape[1]
    rgb = np.zeros((n, 3), np.float32)
    total = np.zeros(n, np.float32)
    share = np.zeros(len(stack.photos))
    if len(stack.photos):
        factor = gain[stack.photos].astype(np.float32)
        for start in range(0, n, BLOCK):
            part = slice(start, start + BLOCK)
            weight = stack.weight[:, part]
            color = stack.rgb[:, :, part] * factor[:, :, None]
            trust = weight
            if options.robust_rounds:
                trust = robust_weights(color, weight, options.robust_scale, options.robust_rounds)
                trust *= weight ** np.float32(options.preference - 0.5)
            norm = trust.sum(axis=0)
            trust = trust / np.maximum(norm, np.float32(1e-20))
            rgb[part] = np.einsum("pn,pcn->nc", trust, color)
            total[part] = weight.sum(axis=0)
            share += trust.sum(axis=1)
    count = np.count_nonzero(stack.weight, axis=0).astype(np.uint16)
    return Blend(rgb, total, count, share)


def robust_weights(color: Floats, weight: Floats, scale: float, iterations: int) -> Floats:
    """(p, n) weights of a robust mean by iteratively reweighted least squares, Cauchy loss.

    color: (p, 3, n) linear light; weight: (p, n). Starts from the mean by the square roots of the
    weights, so that no single photo decides where the iteration begins. Differences are measured
    on square roots, which is close to how an eye weighs them.
    """
    encoded = np.sqrt(color)
    trust = np.sqrt(weight)
    base = trust
    inverse = np.float32(1 / scale**2)
    for _ in range(iterations):
        norm = np.maximum(trust.sum(axis=0), np.float32(1e-20))
        center = (trust[:, None] * encoded).sum(axis=0) / norm
        residual = encoded - center
        residual *= residual
        trust = base / (1 + residual.sum(axis=1) * inverse)
    return trust
