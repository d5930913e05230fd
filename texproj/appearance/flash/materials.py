"""The few materials that a surface is made of, out of many candidates."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Floats

MOST = 8
LEAST_FALL = 0.03
"""Part of what all candidates explain together, beyond the best single one, that one material more
has to explain: true ones bring 6 % and more, what splits noise below 1 %.
"""

SWAPS = 3


def base_materials(cost: Floats) -> list[int]:
    """The columns of (n, k) costs that explain all points best, each by its best one.

    Greedy facility location with swaps (Kuehn and Hamburger 1963; Teitz and Bart 1968).
    """
    chosen: list[int] = []
    best = np.full(len(cost), np.inf, np.float32)
    total = np.inf
    single = float(cost.mean(axis=0).min())
    least = LEAST_FALL * (single - float(cost.min(axis=1).mean()))
    while len(chosen) < MOST:
        sums = np.minimum(cost, best[:, None]).mean(axis=0)
        new = int(np.argmin(sums))
        if chosen and total - sums[new] < max(least, 1e-6):
            break
        chosen = _swapped(cost, [*chosen, new])
        best = cost[:, chosen].min(axis=1)
        total = float(best.mean())
    return chosen


def _swapped(cost: Floats, chosen: list[int]) -> list[int]:
    """Each in turn replaced by what is better beside the others, until none is."""
    for _ in range(SWAPS if len(chosen) > 1 else 0):
        before = list(chosen)
        for number in range(len(chosen)):
            others = cost[:, chosen[:number] + chosen[number + 1 :]].min(axis=1)
            sums = np.minimum(cost, others[:, None]).mean(axis=0)
            chosen[number] = int(np.argmin(sums))
        if chosen == before:
            break
    return chosen
