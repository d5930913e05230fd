"""Where the sun stands, if there is one: the direction whose cast shadows the colors show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from texproj.appearance.cells import Spots
from texproj.appearance.light_fit import LightFit, LitPoints, SunTrial
from texproj.appearance.transfer import SUN_RAYS, LightCaster
from texproj.arrays import Doubles, Index
from texproj.render.directions import tangents

DIRECTIONS = 200
"""Tried over the whole sphere: 15 degrees apart."""

SEARCHED = 1500
"""Points by which they are compared."""

COARSE_DEG, FINE_DEG = (6.0, 3.0, 1.5), (1.0, 0.5, 0.25)
"""Radii of the rings around the best direction that are tried next."""

MOST_STEPS = 3

RING = 8
BEST = 3
"""Directions that are followed up: the sun's own is among them where there is one."""


def find_sun(
    caster: LightCaster, chosen: Index, points: LitPoints, without: LightFit
) -> tuple[Doubles, LitPoints]:
    """The sun that explains the points best beside a sky: unit vector towards it, and the points
    with their cosine to it. Whether there is one is for the caller to judge.

    chosen: the vertices that the points are; without: the light found without a sun.
    """

    def spreads(rows: Index, spots: Spots) -> Callable[[Doubles], float]:
        trial = SunTrial(points.take(rows), without)
        return lambda to_sun: trial.spread(caster.sun(spots, to_sun).astype(np.float64))

    few = np.arange(0, len(chosen), max(1, len(chosen) // SEARCHED))
    coarse = spreads(few, caster.cells.spots(chosen[few], 1))
    spots = caster.cells.spots(chosen, SUN_RAYS)
    tried = sorted(spiral(DIRECTIONS), key=coarse)[:BEST]
    found = min((_refined(start, coarse, COARSE_DEG) for start in tried), key=coarse)
    found = _refined(found, spreads(np.arange(len(chosen)), spots), FINE_DEG)
    return found, replace(points, sun=caster.sun(spots, found).astype(np.float64))


def _refined(start: Doubles, cost: Callable[[Doubles], float], steps: Sequence[float]) -> Doubles:
    """The best direction that steps along shrinking rings lead to."""
    best, least = start, cost(start)
    for step in steps:
        for _ in range(MOST_STEPS):
            ring = around(best, step)
            costs = [cost(direction) for direction in ring]
            if min(costs) >= least:
                break
            best, least = ring[int(np.argmin(costs))], min(costs)
    return best


def spiral(count: int) -> Doubles:
    """(count, 3) unit vectors spread over the sphere (Vogel's spiral)."""
    number = np.arange(count)
    z = 1 - 2 * (number + 0.5) / count
    angle = number * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)


def around(direction: Doubles, angle_deg: float) -> Doubles:
    """(RING, 3) unit vectors so far from a direction."""
    b1, b2 = (b[0].astype(np.float64) for b in tangents(direction[None].astype(np.float32)))
    turn = 2 * np.pi * np.arange(RING) / RING
    aside = np.cos(turn)[:, None] * b1 + np.sin(turn)[:, None] * b2
    out = direction + np.tan(np.radians(angle_deg)) * aside
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def angle_deg(a: Doubles, b: Doubles) -> float:
    """Between two unit vectors."""
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))
