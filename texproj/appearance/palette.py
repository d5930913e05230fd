"""A palette of paints: points of one hue have one albedo, so that what varies among them is light.

Barron and Malik's palette prior ("Shape, illumination, and reflectance from shading", PAMI 2015,
sec. 4.2: few albedos) in its plainest form: clusters of log chroma, which light of one color leaves
alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from texproj.arrays import Doubles, Index

CLUSTERS = 8
"""4 to 32 do alike."""

ROUNDS = 10
NO_DIFFERENCE = 1e-6
DARKEST = 1e-3
"""Linear light below which a chroma is noise."""


def log_chroma(rgb: NDArray[np.floating]) -> Doubles:
    """(n, 2) log of red and of blue against green."""
    log = np.log(np.maximum(rgb, DARKEST).astype(np.float64))
    return log[:, [0, 2]] - log[:, 1:2]


def clusters(chroma: Doubles, count: int = CLUSTERS) -> Doubles:
    """(k, 2) middles of the clusters of (n, 2) chroma: k-means (Lloyd 1982) from the points that
    are farthest from each other, but for the farthest 2 %, which are noise. k <= count.
    """
    middle = np.median(chroma, axis=0)
    far = np.linalg.norm(chroma - middle, axis=1)
    kept = chroma[far <= np.quantile(far, 0.98)]
    centers = kept[[np.argmin(np.linalg.norm(kept - middle, axis=1))]]
    while len(centers) < count:
        distance, _ = cKDTree(centers).query(kept)
        if distance.max() < NO_DIFFERENCE:
            break
        centers = np.append(centers, kept[[distance.argmax()]], axis=0)
    return moved(chroma, centers, ROUNDS)


def moved(chroma: Doubles, centers: Doubles, rounds: int) -> Doubles:
    """(k, 2) centers after rounds of k-means."""
    for _ in range(rounds):
        label = members(chroma, centers)
        size = np.bincount(label, minlength=len(centers))
        sums = [np.bincount(label, chroma[:, k], len(centers)) for k in range(2)]
        means = np.stack(sums, axis=1) / np.maximum(size, 1)[:, None]
        centers = np.where(size[:, None] > 0, means, centers)
    return centers


def members(chroma: Doubles, centers: Doubles) -> Index:
    """(n,) the nearest center of each point."""
    return np.asarray(cKDTree(centers).query(chroma)[1], np.intp)


def medians(values: Doubles, label: Index, count: int) -> Doubles:
    """(k, 3) median of (n, 3) values in each cluster; that of all where a cluster is empty."""
    usual = np.median(values, axis=0)
    parts = [values[label == k] for k in range(count)]
    return np.array([np.median(part, axis=0) if len(part) else usual for part in parts])
