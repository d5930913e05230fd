"""How bright each photo is against the others, from the surface that they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.color.points import Floats
from texproj.color.spill import Spill, Stack

DARKEST, BRIGHTEST = 0.003, 0.92
"""Linear values between which a photo's response is trusted: above the noise and the rounding of
8 bits, below clipping."""

SURE_WEIGHT = 0.02
"""Samples with less weight (borders, silhouettes, glancing views) tell nothing of the exposure."""

PRIOR = 1e-4
"""Weight of the prior (log gain 0) against one overlapping point: enough for photos that share
nothing with others, nothing against a real overlap."""

ROUNDS = 12


@dataclass(frozen=True, eq=False)
class Gains:
    """Factors on linear light that make the photos agree.

    factor: (p, 3) float32 per photo and channel, geometric mean 1 over the photos that overlap;
    spread: (p,) median absolute log difference to the others after correction; points: (p,)
    points that the photo shares with another one.
    """

    factor: Floats
    spread: Floats
    points: NDArray[np.int64]


def no_gains(photos: int) -> Gains:
    """Every photo as it is."""
    return Gains(
        np.ones((photos, 3), np.float32), np.zeros(photos, np.float32), np.zeros(photos, np.int64)
    )


def solve_gains(spill: Spill, photos: int, points: int = 20_000) -> Gains:
    """Per-photo, per-channel gains by robust least squares on log colors of shared points.

    Unknown are the log gain of each photo and the log color of each point; the points are
    eliminated, so that a (p, p) system is left. Cauchy weights, scale from the median residual,
    reset in each of `ROUNDS` rounds. Gauge: mean log gain 0 (by `PRIOR`).
    """
    log_rgb, valid = _observations(spill.survey(points), photos)
    shared = valid & (valid.sum(axis=0) > 1)
    weight = shared.astype(np.float64)
    log_gain = np.zeros((photos, 3))
    residual = np.zeros_like(log_rgb)
    for _ in range(ROUNDS):
        log_gain = _solve(log_rgb, weight)
        corrected = log_rgb + log_gain[:, None]
        norm = np.maximum(weight.sum(axis=0), 1e-12)
        center = (weight[..., None] * corrected).sum(axis=0) / norm[:, None]
        residual = np.abs(corrected - center).mean(axis=2)
        scale = max(2.0 * float(np.median(residual[shared])), 1e-3) if shared.any() else 1.0
        weight = shared / (1 + (residual / scale) ** 2)
    spread = [np.median(r[s]) if s.any() else 0.0 for r, s in zip(residual, shared, strict=True)]
    log_gain -= log_gain[shared.any(axis=1)].mean(axis=0) if shared.any() else 0
    return Gains(
        np.exp(log_gain).astype(np.float32),
        np.array(spread, np.float32),
        shared.sum(axis=1).astype(np.int64),
    )


def _observations(
    stacks: Sequence[Stack], photos: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(p, n, 3) log colors and (p, n) whether they can be trusted."""
    count = sum(stack.weight.shape[1] for stack in stacks)
    log_rgb = np.zeros((photos, count, 3))
    valid = np.zeros((photos, count), bool)
    start = 0
    for stack in stacks:
        part = slice(start, start := start + stack.weight.shape[1])
        rgb = stack.rgb.transpose(0, 2, 1)
        log_rgb[stack.photos, part] = np.log(np.maximum(rgb, DARKEST / 2))
        sound = (rgb > DARKEST).all(axis=2) & (rgb < BRIGHTEST).all(axis=2)
        valid[stack.photos, part] = sound & (stack.weight > SURE_WEIGHT)
    return log_rgb, valid


def _solve(log_rgb: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """(p, 3) log gains of the weighted least squares problem, points eliminated."""
    norm = np.maximum(weight.sum(axis=0), 1e-12)
    normal = np.diag(weight.sum(axis=1)) - (weight / norm) @ weight.T
    normal += PRIOR * np.eye(len(weight))
    center = (weight[..., None] * log_rgb).sum(axis=0) / norm[:, None]
    right = np.einsum("pn,pnc->pc", weight, center - log_rgb)
    return np.linalg.solve(normal, right)
