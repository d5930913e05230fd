"""Cut a surface into few, nearly flat regions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from texproj.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SMOOTHING_ROUNDS = 3
COMPACTNESS = 1e-3  # prefers small regions and long borders where the flatness does not decide


@dataclass(frozen=True, eq=False)
class DualGraph:
    """Faces that share an edge.

    pairs: (E, 2) int64 faces; lengths: (E,) of the shared edges, mesh units; corners: (E, 2)
    int64 vertices of the edge. Only edges with exactly two faces that run through it in opposite
    directions count: at others (borders, three sheets in one edge, a Moebius strip's seam) the
    surface ends.
    """

    pairs: Ints
    lengths: Floats
    corners: Ints

    def within(self, labels: Ints) -> NDArray[np.bool_]:
        """(E,) whether both faces have the same label."""
        return labels[self.pairs[:, 0]] == labels[self.pairs[:, 1]]


def dual_graph(mesh: Mesh) -> DualGraph:
    """The dual graph of the mesh."""
    start = mesh.faces.astype(np.int64).ravel()
    end = np.roll(mesh.faces, -1, axis=1).astype(np.int64).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    key = low * len(mesh.vertices) + high
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    twice = first[np.diff(first, append=len(order)) == 2]
    one, two = order[twice], order[twice + 1]
    opposite = start[one] == end[two]
    one, two = one[opposite], two[opposite]
    corners = np.stack([start[one], end[one]], axis=1)
    ends = mesh.vertices[corners]
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    return DualGraph(np.stack([one // 3, two // 3], axis=1), lengths, corners)


def smoothed_normals(area_normals: Floats, graph: DualGraph) -> Floats:
    """(F, 3) normals of length area, averaged over the neighbors so that noise does not count."""
    count = len(area_normals)
    i, j = graph.pairs.T
    weights = np.ones(2 * len(i), np.float32)
    neighbors = sparse.csr_matrix((weights, (np.r_[i, j], np.r_[j, i])), shape=(count, count))
    area = np.linalg.norm(area_normals, axis=1, keepdims=True).astype(np.float32)
    normals = area_normals.astype(np.float32)
    tiny = np.float32(1e-30)
    for _ in range(SMOOTHING_ROUNDS):
        normals = normals + neighbors @ normals
        normals *= area / (np.linalg.norm(normals, axis=1, keepdims=True) + tiny)
    return normals.astype(np.float64)


def grow_regions(normals: Floats, pairs: Ints, lengths: Floats, flatness: float) -> Ints:
    """(F,) int64 labels 0..n-1 of connected regions grown by merging neighbors.

    normals: (F, 3) of length area. A region with area A and summed normal N deviates from flat
    by D = A - |N| (half the L2,1 energy of Cohen-Steiner, Alliez and Desbrun 2004); of all
    neighbors those merge first whose rise of D per length of common border is least (the full
    lambda schedule of Mumford-Shah segmentation, Robinson et al. 2002), as long as
    |N| >= flatness * A. In each round all pairs merge that are each other's best.
    """
    regions = _Regions(normals, np.linalg.norm(normals, axis=1))
    labels = np.arange(len(normals))
    borders = _merge_parallel(pairs, lengths, len(normals))
    while len(borders.lengths):
        cost, allowed = regions.merge_cost(borders, flatness)
        borders = borders.keep(allowed)
        winners = _mutual_best(borders.pairs, cost[allowed], len(regions.area))
        into = _relabel(borders.pairs[winners], len(regions.area))
        labels = into[labels]
        regions = regions.merged(into)
        borders = _merge_parallel(into[borders.pairs], borders.lengths, len(regions.area))
    return labels


def connected(labels: Ints, graph: DualGraph) -> Ints:
    """(F,) int64 labels 0..n-1 of the connected parts of the regions."""
    pairs = graph.pairs[graph.within(labels)]
    count = len(labels)
    links = sparse.coo_matrix((np.ones(len(pairs), np.int8), pairs.T), shape=(count, count))
    return connected_components(links, directed=False)[1].astype(np.int64)


def sum_by_label(values: Floats, labels: Ints, count: int) -> Floats:
    """(count, k) sums of (F, k) values over equal labels."""
    sums = [np.bincount(labels, column, count) for column in values.T]
    return np.stack(sums, axis=1)


@dataclass(frozen=True, eq=False)
class _Borders:
    pairs: Ints
    lengths: Floats

    def keep(self, mask: NDArray[np.bool_]) -> _Borders:
        return _Borders(self.pairs[mask], self.lengths[mask])


@dataclass(frozen=True, eq=False)
class _Regions:
    normals: Floats
    area: Floats

    def merge_cost(self, borders: _Borders, flatness: float) -> tuple[Floats, NDArray[np.bool_]]:
        i, j = borders.pairs.T
        length = np.linalg.norm(self.normals, axis=1)
        joint = np.linalg.norm(self.normals[i] + self.normals[j], axis=1)
        rise = length[i] + length[j] - joint
        cost = rise + COMPACTNESS * np.minimum(self.area[i], self.area[j])
        return cost / borders.lengths, joint >= flatness * (self.area[i] + self.area[j])

    def merged(self, into: Ints) -> _Regions:
        count = int(into.max()) + 1
        return _Regions(
            sum_by_label(self.normals, into, count),
            sum_by_label(self.area[:, None], into, count)[:, 0],
        )


def _merge_parallel(pairs: Ints, lengths: Floats, count: int) -> _Borders:
    """Borders between different regions, one for each pair of regions."""
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    real = low != high
    key = low[real] * count + high[real]
    order = np.argsort(key)
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    if len(first) == 0:
        return _Borders(np.zeros((0, 2), np.int64), np.zeros(0))
    total = np.add.reduceat(lengths[real][order], first)
    return _Borders(np.stack([key[first] // count, key[first] % count], axis=1), total)


def _mutual_best(pairs: Ints, cost: Floats, count: int) -> Ints:
    """Rows that are the cheapest of both their regions; equal costs are decided by a hash."""
    best = np.full(count, np.inf)
    for side in pairs.T:
        np.minimum.at(best, side, cost)
    rows = np.flatnonzero((cost <= best[pairs].T).all(axis=0))
    ticket = rows * 2654435761 % 2**32
    first = np.full(count, 2**32)
    for side in pairs[rows].T:
        np.minimum.at(first, side, ticket)
    return rows[(ticket == first[pairs[rows]].T).all(axis=0)]


def _relabel(merging: Ints, count: int) -> Ints:
    """(count,) int64 new labels 0..n-1 after the second of each pair joined the first."""
    into = np.arange(count)
    into[merging[:, 1]] = merging[:, 0]
    kept = np.ones(count, bool)
    kept[merging[:, 1]] = False
    return (np.cumsum(kept) - 1)[into]
