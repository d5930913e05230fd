"""Which photos are worth matching: all with all while they are few, else those that look alike.

Photos are compared by VLAD (Jegou et al., "Aggregating local descriptors into a compact image
representation", CVPR 2010) of their features: descriptors' offsets from the nearest of a few
centers, summed. Photos taken one after another are matched too.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from texproj.arrays import Floats

ALL_WITH_ALL = 60
"""Photos up to which every pair is matched: 1770 pairs, some minutes."""
ALIKE = 30
"""Photos that each is matched with, those most alike."""
IN_TURN = 5
"""Photos before and after each in the order of their names."""
CENTERS = 32
TRAINED_ON = 20_000
"""Descriptors from which the centers are found."""
COMPARED = 512
"""Photos whose likeness to all others is in memory at once."""


def chosen_pairs(count: int, vectors: Floats | None) -> list[tuple[int, int]]:
    """Pairs (i < j) of `count` photos. vectors: (count, d) of `vlad` if there are more than
    `ALL_WITH_ALL`.
    """
    if count <= ALL_WITH_ALL or vectors is None:
        return [(i, j) for i in range(count) for j in range(i + 1, count)]
    found = {(i, j) for i in range(count) for j in range(i + 1, min(i + 1 + IN_TURN, count))}
    for start in range(0, count, COMPARED):
        likeness = vectors[start : start + COMPARED] @ vectors.T
        rows = np.arange(len(likeness))
        likeness[rows, rows + start] = -np.inf
        best = np.argpartition(-likeness, ALIKE, axis=1)[:, :ALIKE]
        for i, near in zip(rows + start, best, strict=True):
            found |= {(min(i, j), max(i, j)) for j in near.tolist()}
    return sorted((int(i), int(j)) for i, j in found)


def centers_of(samples: Floats) -> Floats:
    """(CENTERS, 128) typical descriptors, the same for the same samples (n, 128)."""
    cv2.setRNGSeed(0)
    criteria = (cv2.TERM_CRITERIA_MAX_ITER + cv2.TERM_CRITERIA_EPS, 20, 1e-3)
    count = min(CENTERS, len(samples))
    return cv2.kmeans(samples, count, None, criteria, 1, cv2.KMEANS_PP_CENTERS)[2]


def vlad(descriptors: Floats, centers: Floats) -> Floats:
    """(CENTERS * 128,) unit vector of a photo, signed square roots as is usual."""
    if not len(descriptors):
        return np.zeros(centers.size, np.float32)
    gaps = (centers**2).sum(axis=1) - 2 * descriptors @ centers.T
    nearest = gaps.argmin(axis=1)
    total = np.zeros_like(centers)
    np.add.at(total, nearest, descriptors - centers[nearest])
    total = np.sign(total) * np.sqrt(np.abs(total))
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    flat = total.ravel()
    return (flat / max(float(np.linalg.norm(flat)), 1e-12)).astype(np.float32)


def most_alike(
    descriptors: Sequence[Floats], sampled: int, most: int
) -> tuple[tuple[int, ...], ...]:
    """For each photo up to `most` others, the most alike first.

    descriptors: (n, 128) of each photo, n > 0; sampled: of how many of each typical ones are found.
    """
    if not descriptors:
        return ()
    some = [rows[:: max(1, len(rows) // sampled)].astype(np.float32) for rows in descriptors]
    centers = centers_of(training_sample(some))
    vectors = np.stack([vlad(rows.astype(np.float32), centers) for rows in descriptors])
    found: list[tuple[int, ...]] = []
    for start in range(0, len(vectors), COMPARED):
        likeness = vectors[start : start + COMPARED] @ vectors.T
        rows = np.arange(len(likeness))
        likeness[rows, rows + start] = -np.inf
        order = np.argsort(-likeness, axis=1, kind="stable")[:, : min(most, len(vectors) - 1)]
        found += [tuple(row) for row in order.tolist()]
    return tuple(found)


def training_sample(descriptors: Sequence[Floats]) -> Floats:
    """(n, 128) evenly from all photos."""
    rows = np.concatenate(descriptors)
    return rows[:: max(1, len(rows) // TRAINED_ON)]
