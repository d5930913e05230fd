"""Roughness and mirror of a material from all of its points together, colors eliminated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from texproj.appearance.flash.closed_form import fit_material
from texproj.appearance.flash.observations import Observations
from texproj.appearance.flash.reflection import DIELECTRIC, Material
from texproj.arrays import Floats, Index

POINTS = 4000
FEWEST = 20
BEST = 0.6
"""Part of the points that tell."""

SMOOTH = 0.6
"""Roughness from which on the mirror of a dielectric drowns in its paint: F0 is taken for usual."""

STEP = 0.06
"""Half of the range of roughness about the candidate that is looked at."""

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
    """material: found; f0_known: its mirror is told by the photos; points: of how many."""

    material: Material
    f0_known: bool
    points: int


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


def _best(seen: Observations, material: Material) -> Observations:
    """The points that the material fits best: not those in light from around, or of wrong normals,
    which look rougher.
    """
    cost = fit_material(seen, material, ROUNDS).cost
    return seen.of_points(np.flatnonzero(cost <= np.quantile(cost, BEST)))


def _refined(seen: Observations, start: Material) -> Pooled:
    low, high = max(start.roughness - STEP, 0.08), min(start.roughness + STEP, 1.0)

    def cost(material: Material) -> float:
        return float(_mean_cost(seen, material)) + material.sharpness

    def best(values: tuple[float, float], change: Callable[[float], Material]) -> float:
        found = minimize_scalar(
            lambda x: cost(change(float(x))), bounds=values, method="bounded",
            options={"xatol": 4e-3, "maxiter": 16},
        )  # fmt: skip
        return float(found.x)

    if start.metal or start.roughness > SMOOTH:
        now = replace(start, roughness=best((low, high), lambda r: replace(start, roughness=r)))
        return Pooled(_edged(now, best), False, seen.count)
    found = minimize(
        lambda x: cost(replace(start, roughness=float(x[0]), f0=float(np.exp(x[1])))),
        [start.roughness, np.log(start.f0)], method="Nelder-Mead",
        bounds=[(low, high), tuple(np.log(F0_BOUNDS))],
        options={"xatol": 2e-3, "fatol": 1e-5, "maxfev": 50, "initial_simplex": _simplex(start)},
    )  # fmt: skip
    now = replace(start, roughness=float(found.x[0]), f0=float(np.exp(found.x[1])))
    now = _edged(now, best)
    off = min(cost(replace(now, f0=now.f0 * factor)) for factor in (0.8, 1.25))
    told = off > (1 + TELLING) * cost(now) and F0_BOUNDS[0] < now.f0 < F0_BOUNDS[1]
    return Pooled(now if told else replace(now, f0=DIELECTRIC), bool(told), seen.count)


def _edged(
    now: Material, best: Callable[[tuple[float, float], Callable[[float], Material]], float]
) -> Material:
    """With its own edge: after the roughness, which hardly depends on it."""
    if now.metal:
        return now
    return replace(now, edge=best(EDGE_BOUNDS, lambda edge: replace(now, edge=edge)))


def _simplex(start: Material) -> list[list[float]]:
    r, f = start.roughness, float(np.log(start.f0))
    return [[r, f], [r + 0.03, f], [r, f + 0.25]]


def _mean_cost(seen: Observations, material: Material) -> np.floating:
    cost: Floats = fit_material(seen, material, ROUNDS).cost
    return cost.mean()
