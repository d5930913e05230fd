"""The lamps of a room: those whose light and cast shadows explain the photos best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from texproj.appearance.flash.observations import Surfel
from texproj.appearance.palette import log_chroma, members
from texproj.appearance.sightings import Sightings
from texproj.appearance.sun import around as ring
from texproj.appearance.sun import spiral
from texproj.appearance.turntable.lamps import RoomLamp, RoomLight, varied
from texproj.appearance.turntable.room_fit import (
    RoomFit,
    albedo_of,
    bounded,
    fit_room,
    gauged,
    spread_of,
    stepped,
)
from texproj.arrays import Bools, Doubles
from texproj.photo import LUMINANCE

MOST_LAMPS = 3
LAMP_GAIN = 0.015
"""Part of the spread that a lamp has to explain: with what explained 1.9 and 2.6 % photos that were
held out are predicted .1 and .3 dB better, with a lamp that is not there it grows.
"""

DIRECTIONS = 100
GLANCED, SEARCHED = 1500, 5000
"""Sightings by which lamps are compared, all over the sphere and near the best."""

COARSE_DEG, FINE_DEG = (8.0, 4.0, 2.0), (3.0, 1.5)
BEST = 3
STEPS = 3
QUICK_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Lit:
    """Sightings with all that is known of their light. surfels: the points; sky: (m, 9) irradiance
    by the room's harmonics; around: (m, 3) from the surface itself; lamps: (m, k) by each lamp.
    """

    surfels: Surfel
    seen: Sightings
    sky: Doubles
    around: Doubles
    lamps: Doubles

    @property
    def columns(self) -> Doubles:
        return np.column_stack([self.sky, self.lamps])

    def with_lamp(self, light: RoomLight, lamp: RoomLamp) -> Lit:
        """One lamp more."""
        return replace(self, lamps=np.column_stack([self.lamps, self.by(light, lamp)]))

    def by(self, light: RoomLight, lamp: RoomLamp, rays: int = 8) -> Doubles:
        """(m,) irradiance by a lamp."""
        shown = light.irradiance(lamp, self.surfels, self.seen.point, self.seen.photo, rays)
        return shown.astype(np.float64)

    def kept(self, rows: Bools) -> Lit:
        """Some of the sightings."""
        seen = self.seen.kept(rows)
        return Lit(self.surfels, seen, self.sky[rows], self.around[rows], self.lamps[rows])

    def fit(self, start: Doubles | None = None) -> RoomFit:
        """The light of these."""
        return fit_room(self.seen, self.columns, self.around, start)


def find_lamps(light: RoomLight, lit: Lit, fit: RoomFit) -> tuple[list[RoomLamp], Lit, RoomFit]:
    """Lamps one after the other, as long as each explains a good part of what is left. lit, fit:
    without any.
    """
    lamps: list[RoomLamp] = []
    while len(lamps) < MOST_LAMPS:
        lamp = _best_lamp(light, lit, fit)
        more = lit.with_lamp(light, lamp)
        better = more.fit(fit.light)
        if better.spread > (1 - LAMP_GAIN) * fit.spread:
            break
        lamps, lit, fit = [*lamps, lamp], more, better
    return lamps, lit, fit


def _best_lamp(light: RoomLight, lit: Lit, fit: RoomFit) -> RoomLamp:
    first, trial = _Trial(_fewer(lit, GLANCED), fit), _Trial(_fewer(lit, SEARCHED), fit)

    def cost(lamp: RoomLamp) -> float:
        return trial.spread(trial.lit.by(light, lamp))

    def sharp(lamp: RoomLamp) -> float:
        return first.spread(first.lit.by(light, lamp, 1))

    tried = sorted((RoomLamp(d) for d in spiral(DIRECTIONS)), key=sharp)[:BEST]
    found = min((_turned(one, sharp, COARSE_DEG) for one in tried), key=sharp)
    for _ in range(2):
        found = min([found, *varied(found)], key=cost)
        found = min([found, *varied(found)], key=cost)
        found = _turned(found, cost, FINE_DEG)
    return found


def _turned(
    start: RoomLamp, cost: Callable[[RoomLamp], float], steps: tuple[float, ...]
) -> RoomLamp:
    """The best direction that steps along shrinking rings lead to."""
    best, least = start, cost(start)
    for step in steps:
        for _ in range(STEPS):
            near = [replace(best, direction=d) for d in ring(best.direction, step)]
            costs = [cost(lamp) for lamp in near]
            if min(costs) >= least:
                break
            best, least = near[int(np.argmin(costs))], min(costs)
    return best


def _fewer(lit: Lit, count: int) -> Lit:
    """Every k-th point, about so many sightings."""
    step = max(1, len(lit.seen.point) // count)
    return lit.kept(lit.seen.point % step == 0)


class _Trial:
    """Lamps compared by luminance alone, the paint of each point held."""

    def __init__(self, lit: Lit, fit: RoomFit) -> None:
        self.lit = lit
        irradiance = fit.irradiance(lit.columns, lit.around)
        albedo = gauged(albedo_of(lit.seen, irradiance), irradiance)
        label = members(log_chroma(albedo), fit.centers)
        self._paint = (fit.palette[label] @ LUMINANCE)[:, None]
        self._seen = replace(lit.seen, rgb=(lit.seen.rgb @ LUMINANCE)[:, None])
        self._light, self._columns = fit.light @ LUMINANCE, lit.columns
        self._around = (lit.around @ LUMINANCE)[:, None]

    def spread(self, lamp: Doubles) -> float:
        """As that of a fit, with the sightings' irradiance by one lamp more; inf where it shines on
        none.
        """
        if not lamp.any():
            return np.inf
        columns = np.column_stack([self._columns, lamp])
        light = np.append(self._light, 0.0)[:, None]
        rest = np.zeros_like(self._around)
        for _ in range(QUICK_ROUNDS):
            irradiance = bounded(columns @ light + self._around)
            light, rest = stepped(self._seen, columns, light, irradiance, self._paint)
        return spread_of(rest)
