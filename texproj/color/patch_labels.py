"""One photo for each face: as good as possible, and in large patches.

A Potts model on the faces, minimized by alpha expansion (Boykov, Veksler, Zabih, "Fast approximate
energy minimization via graph cuts", PAMI 2001) with the maximum flow of SciPy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from texproj.color.patch_views import FaceViews
from texproj.color.points import Floats
from texproj.color.segmentation import DualGraph, connected

CYCLES = 4
"""Rounds over all photos at most; more than three hardly change anything."""

STEPS = 50.0
"""Integer steps of the energy per square pixel: SciPy's flow counts in integers."""

LARGEST = 1 << 26
"""Largest capacity, so that sums stay in 32 bits."""

Labels = NDArray[np.int32]


def choose_photos(
    views: FaceViews, graph: DualGraph, areas: NDArray[np.float64], seam_px: float
) -> Labels:
    """(F,) photo of each face, -1 where none shows it.

    areas: (F,) mesh units squared. The energy is, in pixels of the best photo, the sum of cost
    times area over the faces plus `seam_px` times the length of all seams: a seam is worth as
    much as a strip of that width at cost 1.
    """
    seen = views.seen
    area_px = (areas * views.density.astype(np.float64) ** 2).astype(np.float32)
    pairs = graph.pairs[seen[graph.pairs].all(axis=1)]
    lengths = graph.lengths[seen[graph.pairs].all(axis=1)]
    seam = seam_px * lengths * views.density[pairs].mean(axis=1)
    labels = views.photo[:, 0].copy()
    photos = np.unique(views.photo[views.photo >= 0])
    current = _steps(_finite(views.cost[:, 0]) * area_px)
    weight = _steps(seam)
    around = np.bincount(pairs.ravel(), np.repeat(weight, 2), len(labels))
    for _ in range(CYCLES):
        changed = 0
        for photo in photos:
            there = _steps(_finite(views.cost_of(int(photo))) * area_px)
            movable = (
                np.isfinite(views.cost_of(int(photo)))
                & (labels != photo)
                & (there - current <= around)
            )
            switch = _expansion(labels, photo, movable, there - current, (pairs, weight))
            labels[switch] = photo
            current[switch] = there[switch]
            changed += len(switch)
        if changed <= len(labels) // 2000:
            break
    return labels


def _steps(energy: Floats) -> NDArray[np.int64]:
    return np.round(np.clip(STEPS * energy.astype(np.float64), 0, LARGEST)).astype(np.int64)


def _finite(cost: Floats) -> Floats:
    return np.where(np.isfinite(cost), cost, 0)


def _expansion(
    labels: Labels,
    photo: int,
    movable: NDArray[np.bool_],
    rise: NDArray[np.int64],
    edges: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> NDArray[np.intp]:
    """The movable faces that change to `photo` in the best such move.

    rise: (F,) by how much the cost of the face grows; edges: pairs of faces and their weights.
    """
    faces = np.flatnonzero(movable)
    number = np.full(len(labels), -1)
    number[faces] = np.arange(len(faces))
    pairs, weight = edges
    i, j = number[pairs].T
    both = (i >= 0) & (j >= 0)
    differ = labels[pairs[:, 0]] != labels[pairs[:, 1]]
    gain = rise[faces].astype(np.float64)
    # Both free, with A, B, C, D the pair's energy for none, j, i, both moved: A + (C - A) i
    # + (D - C) j + (B + C - A - D) (1 - i) j; here A = w or 0, B = C = w, D = 0.
    before = np.where(differ, weight, 0)
    gain += np.bincount(i[both], (weight - before)[both], len(faces))
    gain -= np.bincount(j[both], weight[both], len(faces))
    for one, column in ((i, 1), (j, 0)):
        alone = (one >= 0) & ~both
        after = np.where(labels[pairs[:, column]] == photo, 0, weight)
        gain += np.bincount(one[alone], (after - before)[alone], len(faces))
    return faces[_cut(gain.astype(np.int64), i[both], j[both], (2 * weight - before)[both])]


def _cut(
    gain: NDArray[np.int64],
    i: NDArray[np.int64],
    j: NDArray[np.int64],
    capacity: NDArray[np.int64],
) -> NDArray[np.intp]:
    """Nodes on the far side of the minimum cut: sum of their `gain` plus capacities of the arcs
    i -> j that lead from outside into them is least.
    """
    n = len(gain)
    if n == 0 or not (gain < 0).any():
        return np.zeros(0, np.intp)
    up, down = np.flatnonzero(gain > 0), np.flatnonzero(gain < 0)
    source, sink = n, n + 1
    row = np.concatenate([np.full(len(up), source), down, i])
    column = np.concatenate([up, np.full(len(down), sink), j])
    value = np.concatenate([gain[up], -gain[down], capacity])
    value = np.minimum(value, LARGEST).astype(np.int32)
    arcs = sparse.csr_array((value, (row, column)), shape=(n + 2, n + 2))
    residual = (arcs - maximum_flow(arcs, source, sink).flow).tocsr()
    residual.eliminate_zeros()
    near = breadth_first_order(residual, source, return_predecessors=False)
    far = np.ones(n + 2, bool)
    far[near] = False
    return np.flatnonzero(far[:n])


def merge_islands(
    labels: Labels, views: FaceViews, graph: DualGraph, area_px: Floats, smallest_px: float
) -> Labels:
    """Labels in which patches below `smallest_px` have joined the neighbor with the longest common
    border, as far as its photo may color all of their faces.
    """
    parts = connected(labels.astype(np.int64), graph)
    total = np.bincount(parts, area_px)
    small = total < smallest_px
    pairs = np.concatenate([graph.pairs, graph.pairs[:, ::-1]])
    lengths = np.tile(graph.lengths, 2)
    own, other = parts[pairs].T
    use = small[own] & (own != other) & (labels[pairs] >= 0).all(axis=1)
    use &= ~small[other]
    photos = int(labels.max(initial=0)) + 1
    key, row = np.unique(own[use] * photos + labels[pairs[use, 1]], return_inverse=True)
    border = np.bincount(row, lengths[use], len(key))
    order = np.argsort(border, kind="stable")
    target = np.full(len(total), -1)
    target[key[order] // photos] = key[order] % photos
    wanted = target[parts]
    allowed = (views.photo == wanted[:, None]).any(axis=1) & (wanted >= 0)
    refused = np.bincount(parts, ~allowed, len(total)) > 0
    return np.where(refused[parts], labels, wanted).astype(np.int32)
