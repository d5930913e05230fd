"""Whether a light is to be believed: parts of the surface that were left out of its fit are
predicted from their chroma alone, with the light and without any.

One light for all photos explains each point's color whatever it is, with the albedo that is left.
So photos that were held out would look the same in either case, and tell nothing; parts of the
surface do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.light_fit import LightFit, LitPoints, fit_light
from texproj.appearance.palette import (
    CLUSTERS,
    DARKEST,
    clusters,
    log_chroma,
    medians,
    members,
)
from texproj.appearance.prediction import LEAST_GAIN_DB, Prediction, psnr
from texproj.arrays import Doubles, Index
from texproj.photo import LUMINANCE

CELLS, SMALL_CELLS = 8, 16
"""Of the diagonal, along each side of a cell that is left out as a whole, and of one within which
colors are compared with the light.
"""

LEAST_SLOPE = 0.4
"""How strongly colors have to follow the predicted light from place to place nearby, 1 = exactly:
0.5 to 1.2 in true light, less as normals are rough; 0.2 to 0.35 where paint varies over long ways,
which a light explains as well. Above 1 there is more than light, as where dirt lies in cavities.
"""

FEWEST_NEARBY = 4
"""Points of one paint in a small cell that can be compared."""

STRONGEST = 1.0
"""Difference (log) from the others of its cell at which a color is cut: paint, not light."""


@dataclass(frozen=True, eq=False)
class Places:
    """Where n points are. half: (n,) which of two halves each belongs to, a chess board of cells;
    cell: (n,) number of the small cell.
    """

    half: NDArray[np.bool_]
    cell: Index

    @classmethod
    def of(cls, xyz: NDArray[np.floating], diagonal: float) -> Places:
        """Of (n, 3) points of a mesh of that diagonal."""
        board = np.floor(xyz / (diagonal / CELLS)).astype(int)
        small = np.floor(xyz / (diagonal / SMALL_CELLS)).astype(int)
        number = np.unique(small, axis=0, return_inverse=True)[1].ravel()
        return cls(board.sum(axis=1) % 2 == 0, number)


@dataclass(frozen=True)
class Verdict(Prediction):
    """Of parts of the surface that were left out, predicted by their chroma. slope: of log color on
    log light there, among near points of one paint.
    """

    slope: float

    @property
    def refusal(self) -> str:
        """Why it is refused, in one sentence; empty where it is not."""
        if self.accepted:
            return ""
        return (
            f"the light cannot be told from the paint here ({self.gain_db:.1f} dB better than no"
            f" light at all, and {self.slope:.1f} as strong; {LEAST_GAIN_DB:.1f} dB and"
            f" {LEAST_SLOPE} are asked for): photograph on a cloudy day, all around and from above"
        )


def judged(points: LitPoints, places: Places, start: LightFit) -> Verdict:
    """The verdict on a kind of light: each half predicted from the fit to the other one."""
    plain, lit = np.empty_like(points.rgb), np.empty_like(points.rgb)
    slope = []
    for fitted in (places.half, ~places.half):
        known, other = points.take(fitted), points.take(~fitted)
        fit = fit_light(known, start)
        lit[~fitted] = fit.predicted(other)
        plain[~fitted] = _by_chroma(known.rgb, other.rgb)
        slope.append(_slope(other, fit, places.cell[~fitted]))
    plain_db, lit_db = psnr(points.rgb, plain), psnr(points.rgb, lit)
    mean = float(np.mean(slope))
    accepted = lit_db - plain_db >= LEAST_GAIN_DB and mean >= LEAST_SLOPE
    return Verdict(bool(accepted), plain_db, lit_db, mean)


def _by_chroma(known: Doubles, other: Doubles) -> Doubles:
    """(n, 3) the usual color of points of the same hue: what no light at all predicts."""
    chroma = log_chroma(known)
    centers = clusters(chroma)
    palette = medians(known, members(chroma, centers), len(centers))
    return palette[members(log_chroma(other), centers)]


def _slope(points: LitPoints, fit: LightFit, cell: Index) -> float:
    """Of log color on log light, among points of one paint in one cell."""
    light = np.log(fit.irradiance(points) @ LUMINANCE)
    color = np.log(np.maximum(points.rgb @ LUMINANCE, DARKEST))
    group = np.unique(cell * CLUSTERS + fit.labels(points), return_inverse=True)[1]
    count = np.bincount(group)
    x, y = (v - (np.bincount(group, v) / count)[group] for v in (light, color))
    x = x * (count[group] >= FEWEST_NEARBY)
    return float((x * np.clip(y, -STRONGEST, STRONGEST)).sum() / max((x * x).sum(), 1e-12))
