"""The color of each point for a material, in closed form and robust, and how well it fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.appearance.flash.observations import Observations
from texproj.appearance.flash.reflection import Material, linear_terms
from texproj.arrays import Floats

CAUCHY_ROUNDS = 3
CAUCHY = 2.0
"""Standard deviations at which an observation counts half."""

BRIGHTEST = 1.0
"""Of colors: nothing reflects more than it gets. Else the flank of a highlight passes for that of a
narrower, brighter one.
"""

MIRRORED_AROUND = 0.03
"""Part of the light from the surface around that a dielectric mirrors, all roughnesses alike."""


@dataclass(frozen=True, eq=False)
class Fit:
    """color: (n, 3); cost: (n,) mean of log(1 + squared standard deviations); both 0 where a point
    has no observation.
    """

    color: Floats
    cost: Floats


def fit_material(seen: Observations, material: Material, rounds: int = CAUCHY_ROUNDS) -> Fit:
    """Every point taken for one material."""
    slope, offset = model_terms(seen, material.values)
    return fit_terms(seen, slope, offset, rounds)


def fit_lambert(seen: Observations) -> Fit:
    """Every point taken for matte: sum of light times color over that of squared light."""
    slope = (seen.light * np.float32(1 / np.pi))[:, None] + seen.around * np.float32(1 / np.pi)
    return fit_terms(seen, slope, np.zeros_like(slope), CAUCHY_ROUNDS)


def fit_each(seen: Observations, materials: Sequence[Material], label: np.ndarray) -> Fit:
    """Every point as the material of its label (n,)."""
    slope, offset = labelled_terms(seen, materials, label)
    return fit_terms(seen, slope, offset, CAUCHY_ROUNDS)


def labelled_terms(
    seen: Observations, materials: Sequence[Material], label: np.ndarray
) -> tuple[Floats, Floats]:
    """(m, 3) slopes and offsets of the observations, each of its point's material."""
    values = np.array([material.values for material in materials], np.float32)
    return model_terms(seen, values[label[seen.point]].T)


def model_terms(seen: Observations, values: Sequence[float] | Floats) -> tuple[Floats, Floats]:
    """(m, 3) slope and offset of what is observed in the point's color: of the flash's own light,
    and of one bounce, which is diffuse. values: of one `Material`, or (4, m) of each.
    """
    slope, offset = linear_terms(values, seen.angles)
    around = seen.around * np.float32(1 / np.pi)
    paint = np.float32(MIRRORED_AROUND) * (1 - np.asarray(values[1], np.float32))
    mirrored = around * paint[..., None]
    return (seen.light * slope)[:, None] + around, (seen.light * offset)[:, None] + mirrored


def fit_terms(seen: Observations, slope: Floats, offset: Floats, rounds: int) -> Fit:
    """Colors by weighted least squares, repeated with Cauchy weights. Of what was cut at white no
    more is asked than to be no darker.
    """
    weight = seen.precision
    wanted = seen.rgb - offset
    color = np.zeros((seen.count, 3), np.float32)
    loss = np.ones(len(seen.point), np.float32)
    open_ended = np.flatnonzero(seen.cut.any(axis=1))
    known = np.ones(wanted.shape, np.float32)
    for _ in range(rounds):
        w = weight * slope * known * loss[:, None]
        top, bottom = seen.sums(w * wanted), seen.sums(w * slope)
        color = np.clip(top / np.maximum(bottom, np.float32(1e-20)), 0, BRIGHTEST)
        off = wanted - slope * color[seen.point]
        over = seen.cut[open_ended] & (off[open_ended] < 0)
        known[open_ended] = ~over
        off[open_ended] *= ~over
        square = np.einsum("ij,ij,ij->i", off, off, seen.inverse_variance) / 3
        loss = 1 / (1 + square / np.float32(CAUCHY**2))
    return Fit(color, _mean_log(seen, square))


def misfit(seen: Observations, slope: Floats, offset: Floats, color: Floats) -> Floats:
    """(n,) costs, as in `Fit`, of colors (n, 3) that are given."""
    off = seen.rgb - offset - slope * color[seen.point]
    off *= ~(seen.cut & (off < 0))
    return _mean_log(seen, np.einsum("ij,ij,ij->i", off, off, seen.inverse_variance) / 3)


def _mean_log(seen: Observations, square: Floats) -> Floats:
    """(n,) mean of log(1 + squared standard deviations (m,))."""
    cost = seen.sums((np.log1p(square) * seen.trust)[:, None])[:, 0]
    total = np.maximum(seen.sums(seen.trust[:, None])[:, 0], 1e-20)
    return np.divide(cost, total, dtype=np.float32)


def predicted(slope: Floats, offset: Floats, seen: Observations, color: Floats) -> Floats:
    """(m, 3) what the photos would show of points of these colors (n, 3)."""
    return slope * color[seen.point] + offset
