"""Metal or paint: told by points nearby that know what they are.

Off its highlight a metal is as black as black paint, and a mixed pixel at its border looks like
paint. Points that a photo saw head-on know better: a metal mirrors the flash there, and paint does
not. Each of them says what the photos would show here if this were its material, in its color;
what they show is likelier as one or as the other (ours).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from texproj.appearance.flash.observations import Observations
from texproj.appearance.flash.reflection import Material
from texproj.arrays import Bools, Floats, Index
from texproj.photo import LUMINANCE

Terms = tuple[Floats, Floats]
"""(m, 3) slopes and offsets of observations in the color, of one material."""

CELL, SHADE = 0.03, 0.25
"""Part of the diagonal, and of log luminance: witnesses of one material within are one."""


FIT, HUE, DIM = 0.25, 0.5, 0.06
"""What the best fit of a material, and votes of points of like hue, count for beside witnesses: the
hue by half of that where the matte color is `DIM`, since it is noise in the dark.
"""


@dataclass(frozen=True)
class _Kind:
    """asked: nearest witnesses of each point; off: what the model is off, as part of what it
    predicts; darkest, brightest: how much another point differs from its witness. A metal's
    flanks are darker than the model has them, by far where the true ones fall off faster.
    """

    asked: int
    off: float
    darkest: float
    brightest: float


PAINT = _Kind(2, 0.1, 0.7, 1.4)
METAL = _Kind(2, 0.5, 0.25, 1.1)


@dataclass(frozen=True, eq=False)
class _Party:
    """Witnesses of one kind. color: (w, 3); label: (w,) materials."""

    kind: _Kind
    tree: cKDTree
    color: Floats
    label: Index

    @classmethod
    def of(cls, kind: _Kind, xyz: Floats, color: Floats, label: Index, cell: float) -> _Party:
        """Points of one kind, those alike and near each other as one."""
        shade = np.log(np.maximum(color @ LUMINANCE, 1e-3)) / SHADE
        cells = np.column_stack([np.floor(xyz / cell), np.floor(shade), label]).astype(np.int64)
        _, at, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        at = at.ravel()
        means = [
            np.stack([np.bincount(at, column) / count for column in values.T], axis=1)
            for values in (xyz, color)
        ]
        named = np.zeros(len(count), np.intp)
        named[at] = label
        return cls(kind, cKDTree(means[0]), means[1].astype(np.float32), named)

    def cost(self, xyz: Floats, seen: Observations, slopes: Floats, offsets: Floats) -> Floats:
        """(n,) of the best of the witnesses nearby: minus the log of Cauchy's density of what is
        seen, mean over the observations. slopes, offsets: (k, m, 3) of each material.
        """
        rows, noise = np.arange(len(seen.point)), np.reciprocal(seen.inverse_variance)
        count = min(self.kind.asked, len(self.label))
        near = self.tree.query(xyz, count, workers=-1)[1].reshape(-1, count)
        best = np.full(len(xyz), np.inf, np.float32)
        for k in range(count):
            here = near[seen.point, k]
            label = self.label[here]
            slope = slopes[label, rows] * self.color[here]
            best = np.minimum(best, self._misfit(seen, slope, offsets[label, rows], noise))
        return best

    def _misfit(self, seen: Observations, slope: Floats, offset: Floats, noise: Floats) -> Floats:
        kind = self.kind
        wanted = seen.rgb - offset
        variance = noise + np.square(np.float32(kind.off) * (slope + offset))
        precision = np.reciprocal(variance)
        weight = seen.trust[:, None] * slope * precision
        both = [np.einsum("ij,ij->i", weight, x) for x in (wanted, slope)]
        top, bottom = seen.sums(np.stack(both, axis=1)).T
        gain = np.clip(top / np.maximum(bottom, np.float32(1e-20)), kind.darkest, kind.brightest)
        wanted -= slope * gain[seen.point, None]
        cut = np.flatnonzero(seen.cut.any(axis=1))
        wanted[cut] *= ~(seen.cut[cut] & (wanted[cut] < 0))
        cost = np.log1p(np.einsum("ij,ij,ij->i", wanted, wanted, precision) / 3)
        cost += np.log(variance.prod(axis=1)) / 6
        both = [cost * seen.trust, seen.trust]
        total, trust = seen.sums(np.stack(both, axis=1)).T
        return np.asarray(total / np.maximum(trust, np.float32(1e-20)), np.float32)


@dataclass(frozen=True, eq=False)
class Witnesses:
    """Points that know what they are. paint, metal: the two parties; kinds: the materials."""

    paint: _Party
    metal: _Party
    kinds: Sequence[Material]

    @classmethod
    def of(
        cls, xyz: Floats, color: Floats, label: Index, knows: Bools, kinds: Sequence[Material],
        diagonal: float,
    ) -> Witnesses | None:  # fmt: skip
        """Those of n points that know; None where all of them are of one party."""
        metal = np.array([kind.metal for kind in kinds])[label]
        paint = knows & ~metal
        metal &= knows
        if not paint.any() or not metal.any():
            return None

        def party(kind: _Kind, rows: Bools) -> _Party:
            return _Party.of(kind, xyz[rows], color[rows], label[rows], CELL * diagonal)

        return cls(party(PAINT, paint), party(METAL, metal), kinds)

    def costs(self, xyz: Floats, seen: Observations, terms: Sequence[Terms]) -> Floats:
        """(n, 2) of paint and of metal, 0 without an observation. terms: of each material."""
        slopes, offsets = (np.stack(one) for one in zip(*terms, strict=True))
        parties = self.paint, self.metal
        return np.stack([one.cost(xyz, seen, slopes, offsets) for one in parties], axis=1)

    def judged(
        self, cost: Floats, told: Floats, votes: Floats, matte: Floats
    ) -> tuple[Floats, Floats]:
        """(n, k) costs and votes of materials. Between paints and metals the witnesses' costs, told
        (n, 2), come first: what fits best in a color of its own, and points of like hue, are wrong
        where a metal is dark. matte: (n, 3) what the points look like.
        """
        bright = matte @ LUMINANCE.astype(np.float32)
        unheard = (1 - np.float32(HUE) * bright / (bright + np.float32(DIM)))[:, None]
        metal = np.array([kind.metal for kind in self.kinds])
        cost, votes = cost.copy(), votes.copy()
        for party, columns in enumerate((np.flatnonzero(~metal), np.flatnonzero(metal))):
            cost[:, columns] -= np.float32(1 - FIT) * cost[:, columns].min(axis=1, keepdims=True)
            cost[:, columns] += told[:, [party]]
            votes[:, columns] -= unheard * votes[:, columns].max(axis=1, keepdims=True)
        return cost, votes
