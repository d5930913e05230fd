"""Colors of points that few photos see, drawn towards those of their neighbors.

One sample in a hollow or at a grazing angle is off by a fifth and more; a paint varies less from
place to place. How much less is found on the surface itself (ours, after empirical Bayes: Efron and
Morris, JASA 1973).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_array

from texproj.appearance.palette import log_chroma
from texproj.arrays import Bools, Floats, Index
from texproj.photo import LUMINANCE

ENOUGH = 3
"""Observations from which on a point tells its neighbors its color."""

WELL_SEEN = 6
"""Observations of points that tell how much colors differ nearby."""

OFF = 0.2
"""Part that one observation in a hollow is off; points of fewer than `ENOUGH` lie deepest, and
theirs count half.
"""

RINGS = 4
DARK = 0.01
HUE = 0.4
"""Difference in log chroma, which a single sample tells well too, up to which neighbors are of one
paint.
"""


def drawn_together(
    color: Floats, label: Index, number: Index, free: Bools, neighbors: Any
) -> Floats:
    """(n, 3) colors, each between its own and the mean of its neighbors of the same label, by what
    they are worth. number: (n,) of observations; free: (n,) which ones to change; neighbors: (n, n)
    sparse mean.
    """
    nearby, known = _means(color, label, number >= ENOUGH, neighbors)
    told = known & free & (number >= WELL_SEEN)
    if np.count_nonzero(told) < WELL_SEEN:
        return color
    apart = np.log(_brightness(color[told]) / _brightness(nearby[told]))
    varied = (1.4826 * float(np.median(np.abs(apart)))) ** 2
    worth = np.where(number >= ENOUGH, number, number / 2)
    own = (worth * varied / (worth * varied + OFF**2)).astype(np.float32)[:, None]
    mixed = own * color + (1 - own) * nearby
    return np.where((known & free)[:, None], mixed, color)


def _means(color: Floats, label: Index, telling: Bools, neighbors: Any) -> tuple[Floats, Bools]:
    """(n, 3) mean color of the telling points around, without the point itself, and (n,) where
    there are any.
    """
    rows, columns = neighbors.tocoo().coords
    hue = log_chroma(color).astype(np.float32)
    alike = np.linalg.norm(hue[rows] - hue[columns], axis=1) < HUE
    same = (label[rows] == label[columns]) & alike
    beside = csr_array((same.astype(np.float32), (rows, columns)), shape=neighbors.shape)
    weight = telling.astype(np.float32)[:, None]
    total = color * weight
    for _ in range(RINGS - 1):
        total, weight = total + beside @ total, weight + beside @ weight
    total, weight = beside @ total, beside @ weight
    return np.divide(total, np.maximum(weight, 1e-6), dtype=np.float32), weight[:, 0] > 0


def _brightness(color: Floats) -> Floats:
    return np.maximum(color @ LUMINANCE.astype(np.float32), np.float32(DARK))
