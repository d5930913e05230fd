"""Mutual information: how much one image tells about another, whatever the relation of their
values (Viola and Wells, "Alignment by maximization of mutual information", IJCV 1997).

Values are in 0..1 and fall on bins whose centers are k / (bins - 1); a value between two centers
counts partly for both (linear partial volume), so that the measure is continuous.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from texproj.arrays import Doubles

Measure = Literal["mutual-information", "normalized"]


@dataclass(frozen=True, eq=False)
class Binned:
    """(n,) values spread over two neighboring bins each: `low` and `low + 1`, the latter with
    the share `upper`.
    """

    low: NDArray[np.intp]
    upper: Doubles
    bins: int


def binned(values: ArrayLike, bins: int) -> Binned:
    """Values in 0..1 (clipped to it, any shape) over `bins` (at least 2) bins."""
    if bins < 2:
        raise ValueError(f"{bins} bins; at least 2 are needed")
    place = np.clip(np.asarray(values, np.float64).ravel(), 0, 1) * (bins - 1)
    low = np.minimum(place.astype(np.intp), bins - 2)
    return Binned(low, place - low, bins)


def joint_histogram(a: Binned, b: Binned, weights: ArrayLike | None = None) -> Doubles:
    """(a.bins, b.bins) weight of the pairs of values; its sum is that of the weights (n,),
    by default 1 each.
    """
    weight = np.ones(len(a.low)) if weights is None else np.asarray(weights, np.float64).ravel()
    base = a.low * b.bins + b.low
    both, in_a = weight * a.upper * b.upper, weight * a.upper
    in_b = weight * b.upper
    flat = np.zeros(a.bins * b.bins)
    parts = ((0, weight - in_a - in_b + both), (1, in_b - both), (b.bins, in_a - both),
             (b.bins + 1, both))  # fmt: skip
    for offset, part in parts:
        flat += np.bincount(base + offset, part, len(flat))
    return flat.reshape(a.bins, b.bins)


def entropy_bits(histogram: ArrayLike) -> float:
    """Shannon entropy of a histogram of any shape, bits; 0 for an empty one."""
    h = np.asarray(histogram, np.float64).ravel()
    total = h.sum()
    if total <= 0:
        return 0.0
    p = h[h > 0] / total
    return float(-(p * np.log2(p)).sum())


def mutual_information_bits(joint: Doubles) -> float:
    """I(a; b) = H(a) + H(b) - H(a, b) of a joint histogram, bits."""
    return entropy_bits(joint.sum(1)) + entropy_bits(joint.sum(0)) - entropy_bits(joint)


def normalized_mutual_information(joint: Doubles) -> float:
    """(H(a) + H(b)) / H(a, b), 1 = independent, 2 = one determines the other (Studholme, Hill and
    Hawkes, "An overlap invariant entropy measure", Pattern Recognition 1999).

    1 where both are constant.
    """
    together = entropy_bits(joint)
    if together == 0:
        return 1.0
    return (entropy_bits(joint.sum(1)) + entropy_bits(joint.sum(0))) / together
