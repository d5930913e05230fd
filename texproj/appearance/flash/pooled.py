"""Roughness and mirror of a material from all of its points together, colors eliminated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from texproj.appearance.flash.closed_form import fit_material
from texproj.appearance.flash.observations import Observations
from texproj.appearance.flash.reflection import DIELECTRIC, Material, usual_edge
from texproj.arrays import Floats, Index

POINTS = 4000
FEWEST = 20
BEST = 0.6
"""Part of the points that tell how a material looks."""

CLEAREST, FEWEST_CLEAR = 0.3, 500
"""Part of a material's points that saw their highlight, and how many at least, that tell what it
is: the clearest ones.
"""

SMOOTH = 0.6
"""Roughness from which on the mirror of a dielectric drowns in its paint: F0 is taken for usual."""

STEP = 0.06
"""Half of the range of roughness about the candidate that is looked at."""

ROUGH = tuple(float(r) for r in np.linspace(SMOOTH, 1.0, 9))
"""Roughnesses at which rough paint is tried, each with its best edge: .72 and .84, with edges as on
the grid of candidates, fit alike, so that the candidate does not count.
"""

FEW = 400
"""Points by which they are tried."""

EDGE_SPREAD, EDGE_PULL = 0.35, 0.01
"""By how much edges differ from the usual one of their roughness among measured paints (Burley
2012, fig. 7), and what that much costs: as much as a hundredth of the noise's own cost.
"""

F0_BOUNDS = (0.01, 0.12)
"""Of dielectrics from porous stone to gems."""

EDGE_BOUNDS = (0.4, 2.6)
"""Of the brightness of a matte edge: from Lambert's less Fresnel to the roughest known."""

TELLING = 0.02
"""Part by which the cost has to rise where F0 is a fifth off, for F0 to be known."""

ROUNDS = 2
"""Of Cauchy weights: a start that is near."""


@dataclass(frozen=True)
class Pooled:
    """material: as it looks on most of the surface; f0_known: its mirror is told by the photos;
    points: of how many; flat: its roughness where the surface is flat, None where nobody asked.
    """

    material: Material
    f0_known: bool
    points: int
    flat: float | None = None

    @property
    def roughness(self) -> float:
        """Its own: where a surface bends it looks rougher than it is."""
        return self.material.roughness if self.flat is None else self.flat


def pooled(seen: Observations, label: Index, known: Sequence[Material]) -> list[Pooled]:
    """Each material refined over its points."""
    rng = np.random.default_rng(0)
    out = []
    for number, material in enumerate(known):
        rows = np.flatnonzero((label == number) & (seen.number >= 3))
        if len(rows) > POINTS:
            rows = np.sort(rng.choice(rows, POINTS, replace=False))
        if len(rows) < FEWEST:
            out.append(Pooled(material, False, len(rows)))
        else:
            out.append(_refined(_best(seen.of_points(rows), material), material))
    return out


def flattened(
    seen: Observations, label: Index, told: Sequence[Pooled], clear: Floats
) -> list[Pooled]:
    """The same with the roughness that each has where points are clear. clear: (n,) how flat the
    surface is, 1 more where a point saw its highlight.
    """
    out = []
    for number, one in enumerate(told):
        rows = np.flatnonzero((label == number) & (seen.number >= 3))
        most = max(round(CLEAREST * np.count_nonzero(clear[rows] > 1)), FEWEST_CLEAR)
        rows = np.sort(rows[np.argsort(-clear[rows], kind="stable")[:most]])
        enough = len(rows) >= FEWEST
        asked = _refined(seen.of_points(rows), one.material) if enough else one
        out.append(replace(one, flat=asked.material.roughness))
    return out


def _best(seen: Observations, material: Material) -> Observations:
    """The points that the material fits best: not those in light from around, or of wrong normals,
    which look rougher.
    """
    cost = fit_material(seen, material, ROUNDS).cost
    return seen.of_points(np.flatnonzero(cost <= np.quantile(cost, BEST)))


def _refined(seen: Observations, start: Material) -> Pooled:
    def cost(material: Material) -> float:
        return float(_mean_cost(seen, material)) + material.sharpness

    if start.metal:
        found = _least(cost, _about(start, STEP), lambda r: replace(start, roughness=r))
        return Pooled(found, False, seen.count)
    if start.roughness > SMOOTH:
        return Pooled(_rough(seen, start), False, seen.count)
    low, high = _about(start, STEP)
    best = minimize(
        lambda x: cost(replace(start, roughness=float(x[0]), f0=float(np.exp(x[1])))),
        [start.roughness, np.log(start.f0)], method="Nelder-Mead",
        bounds=[(low, high), tuple(np.log(F0_BOUNDS))],
        options={"xatol": 2e-3, "fatol": 1e-5, "maxfev": 50, "initial_simplex": _simplex(start)},
    )  # fmt: skip
    now = replace(start, roughness=float(best.x[0]), f0=float(np.exp(best.x[1])))
    now = _edged(now, cost)
    off = min(cost(replace(now, f0=now.f0 * factor)) for factor in (0.8, 1.25))
    told = off > (1 + TELLING) * cost(now) and F0_BOUNDS[0] < now.f0 < F0_BOUNDS[1]
    return Pooled(now if told else replace(now, f0=DIELECTRIC), bool(told), seen.count)


def _rough(seen: Observations, start: Material) -> Material:
    """Roughness and edge of rough paint: by few points all over the range, then by all."""
    few = seen.of_points(np.arange(0, seen.count, max(1, seen.count // FEW)))

    def cost(material: Material, of: Observations = seen) -> float:
        return float(_mean_cost(of, material)) + material.sharpness + _unusual(material)

    def of_few(material: Material) -> float:
        return cost(material, few)

    found = min((_edged(replace(start, roughness=r), of_few) for r in ROUGH), key=of_few)
    bounds = _about(found, ROUGH[1] - ROUGH[0])
    found = _least(cost, bounds, lambda r: replace(found, roughness=r))
    return _edged(found, cost)


Cost = Callable[[Material], float]


def _about(start: Material, step: float) -> tuple[float, float]:
    return max(start.roughness - step, 0.08), min(start.roughness + step, 1.0)


def _least(
    cost: Cost, bounds: tuple[float, float], change: Callable[[float], Material]
) -> Material:
    """The best of the materials that one number changes."""
    found = minimize_scalar(
        lambda x: cost(change(float(x))), bounds=bounds, method="bounded",
        options={"xatol": 4e-3, "maxiter": 16},
    )  # fmt: skip
    return change(float(found.x))


def _edged(now: Material, cost: Cost) -> Material:
    """With its own edge."""
    return _least(cost, EDGE_BOUNDS, lambda edge: replace(now, edge=edge))


def _unusual(material: Material) -> float:
    """What an edge of rough paint costs that is none of its roughness; of glossy paint the
    highlight tells the roughness.
    """
    off = (material.values[3] - usual_edge(material.roughness)) / EDGE_SPREAD
    return EDGE_PULL * off * off


def _simplex(start: Material) -> list[list[float]]:
    r, f = start.roughness, float(np.log(start.f0))
    return [[r, f], [r + 0.03, f], [r, f + 0.25]]


def _mean_cost(seen: Observations, material: Material) -> np.floating:
    cost: Floats = fit_material(seen, material, ROUNDS).cost
    return cost.mean()
