"""Cut a surface into few, nearly flat regions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from texproj.arrays import Doubles, Rows
from texproj.mesh import Mesh, norms
from texproj.unwrap.halfedges import half_edges, opposite

SMOOTHING_ROUNDS = 3
ROUGH_DEG = 8.0
SMALL = 0.1  # of the area of the region joined
COMPACTNESS = 1e-3  # prefers small regions and long borders where the flatness does not decide


@dataclass(frozen=True, eq=False)
class DualGraph:
    """Faces that share an edge.

    pairs: (E, 2) int32 faces; lengths: (E,) of the shared edges, mesh units. Only edges with
    exactly two faces that run through it in opposite directions count: at others (borders,
    three sheets in one edge, a Moebius strip's seam) the surface ends.
    """

    pairs: Rows
    lengths: Doubles

    def within(self, labels: Rows) -> NDArray[np.bool_]:
        """(E,) whether both faces have the same label."""
        return labels[self.pairs[:, 0]] == labels[self.pairs[:, 1]]

    def restricted(self, rows: Rows) -> DualGraph:
        """The graph of some faces only, renumbered in the given order."""
        count = max(int(self.pairs.max(initial=-1)), int(rows.max(initial=-1))) + 1
        number = np.full(count, -1, np.int32)
        number[rows] = np.arange(len(rows), dtype=np.int32)
        pairs = number[self.pairs]
        kept = (pairs[:, 0] >= 0) & (pairs[:, 1] >= 0)
        return DualGraph(pairs[kept], self.lengths[kept])


def dual_graph(mesh: Mesh, rows: Rows | None = None) -> DualGraph:
    """The dual graph of the mesh, or of some of its faces in the given order."""
    start, end = half_edges(mesh.faces if rows is None else mesh.faces[rows])
    one, two = opposite(start, end, len(mesh.vertices))
    length = norms(mesh.vertices[start[one]] - mesh.vertices[end[one]])
    return DualGraph(np.stack([one // 3, two // 3], axis=1), length)


def smoothed_normals(area_normals: Doubles, graph: DualGraph) -> Doubles:
    """(F, 3) normals of length area, averaged over the neighbors so that noise does not count.

    Neighbors count in full up to three quarters of a right angle and not at all beyond a right
    angle, so that the edges of a box stay; where noise bends every edge, all count in full.
    """
    count = len(area_normals)
    area = np.maximum(np.linalg.norm(area_normals, axis=1, keepdims=True), 1e-30)
    area = area.astype(np.float32)
    normals = area_normals.astype(np.float32)
    i, j = graph.pairs.T
    cosine = np.einsum("ij,ij->i", normals[i], normals[j]) / (area[i] * area[j])[:, 0]
    rough = _rough(cosine, graph, count)
    alike = np.where(rough[i] & rough[j], 1, np.clip(4 * cosine, 0, 1))
    neighbors = _symmetric(alike, graph, count)
    for _ in range(SMOOTHING_ROUNDS):
        normals = normals + neighbors @ normals
        normals *= area / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return normals.astype(np.float64)


def _rough(cosine: Doubles, graph: DualGraph, count: int) -> NDArray[np.bool_]:
    """(F,) faces in whose neighborhood not even the best of a face's neighbors is level with it."""
    best = np.full(count, -1.0)
    for side in graph.pairs.T:
        np.maximum.at(best, side, cosine)
    best[best == -1] = 1
    neighbors = _symmetric(np.ones(len(cosine)), graph, count)
    members = 1 + neighbors.sum(axis=1)
    mean = (best + neighbors @ best) / members
    mean = (mean + neighbors @ mean) / members
    return mean < np.cos(np.radians(ROUGH_DEG))


def _symmetric(weights: Doubles, graph: DualGraph, count: int) -> sparse.csr_array:
    i, j = graph.pairs.T
    both = np.tile(weights.astype(np.float32), 2)
    return sparse.csr_array((both, (np.r_[i, j], np.r_[j, i])), shape=(count, count))


def grow_regions(
    normals: Doubles, area: Doubles, pairs: Rows, lengths: Doubles, flatness: float
) -> Rows:
    """(F,) int64 labels 0..n-1 of connected regions grown by merging neighbors.

    normals: (F, 3) of faces or regions to start with, of length area where these are flat; area:
    (F,); pairs: (E, 2) neighbors; lengths: (E,) of their common border. A region with area A and
    summed normal N deviates from flat by D = A - |N| (half the L2,1 energy of Cohen-Steiner, Alliez
    and Desbrun 2004); of all neighbors those merge first whose rise of D per length of common
    border is least (the full lambda schedule of Mumford-Shah segmentation, Robinson et al. 2002),
    as long as |N| >= flatness * A. In each round all pairs merge that are each other's best.
    """
    regions = _Regions(normals, area)
    labels = np.arange(len(normals))
    borders = _merge_parallel(pairs, lengths, len(normals))
    while len(borders.lengths):
        cost, allowed = regions.merge_cost(borders, flatness)
        borders = borders.keep(allowed)
        target = _best_neighbor(borders.pairs, cost[allowed], len(regions.area))
        into = _joined(target, regions.area)
        labels = into[labels]
        regions = regions.merged(into)
        borders = _merge_parallel(into[borders.pairs], borders.lengths, len(regions.area))
    return labels


def connected(labels: Rows, graph: DualGraph) -> Rows:
    """(F,) int64 labels 0..n-1 of the connected parts of the regions."""
    pairs = graph.pairs[graph.within(labels)]
    count = len(labels)
    links = sparse.coo_matrix((np.ones(len(pairs), np.int8), pairs.T), shape=(count, count))
    return connected_components(links, directed=False)[1].astype(np.int64)


def sum_by_label(values: Doubles, labels: Rows, count: int) -> Doubles:
    """(count, k) sums of (F, k) values over equal labels."""
    sums = [np.bincount(labels, column, count) for column in values.T]
    return np.stack(sums, axis=1)


@dataclass(frozen=True, eq=False)
class _Borders:
    pairs: Rows
    lengths: Doubles

    def keep(self, mask: NDArray[np.bool_]) -> _Borders:
        return _Borders(self.pairs[mask], self.lengths[mask])


@dataclass(frozen=True, eq=False)
class _Regions:
    normals: Doubles
    area: Doubles

    def merge_cost(self, borders: _Borders, flatness: float) -> tuple[Doubles, NDArray[np.bool_]]:
        i, j = borders.pairs.T
        length = norms(self.normals)
        joint = norms(self.normals[i] + self.normals[j])
        rise = length[i] + length[j] - joint
        cost = rise + COMPACTNESS * np.minimum(self.area[i], self.area[j])
        return cost / borders.lengths, joint >= flatness * (self.area[i] + self.area[j])

    def merged(self, into: Rows) -> _Regions:
        count = int(into.max()) + 1
        return _Regions(
            sum_by_label(self.normals, into, count),
            sum_by_label(self.area[:, None], into, count)[:, 0],
        )


def _merge_parallel(pairs: Rows, lengths: Doubles, count: int) -> _Borders:
    """Borders between different regions, one for each pair of regions."""
    low, high = np.minimum(*pairs.T), np.maximum(*pairs.T)
    real = low != high
    key = low[real].astype(np.int64) * count + high[real]
    order = np.argsort(key)
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    if len(first) == 0:
        return _Borders(np.zeros((0, 2), np.int64), np.zeros(0))
    total = np.add.reduceat(lengths[real][order], first)
    return _Borders(np.stack([key[first] // count, key[first] % count], axis=1), total)


def _best_neighbor(pairs: Rows, cost: Doubles, count: int) -> Rows:
    """(count,) the cheapest neighbor of each region, itself where it has none; a hash decides
    between equal costs.
    """
    best = np.full(count, np.inf)
    for side in pairs.T:
        np.minimum.at(best, side, cost)
    ticket = np.arange(len(pairs)) * 2654435761 % 2**32
    first = np.full(count, 2**32)
    for side in pairs.T:
        rows = np.flatnonzero(cost <= best[side])
        np.minimum.at(first, side[rows], ticket[rows])
    target = np.arange(count)
    for side, other in (pairs.T, pairs.T[::-1]):
        rows = np.flatnonzero((cost <= best[side]) & (ticket == first[side]))
        target[side[rows]] = other[rows]
    return target


def _joined(target: Rows, area: Doubles) -> Rows:
    """(n,) labels 0..m-1 after regions that chose each other merged, and small ones joined the
    large region of their choice.
    """
    own = np.arange(len(target))
    mutual = (target[target] == own) & (target != own)
    small = ~mutual & (area <= SMALL * area[target]) & (target != own)
    into = np.where(mutual, np.minimum(own, target), own)
    joins = small & ~small[target]
    into[joins] = into[target[joins]]
    kept = into == own
    return (np.cumsum(kept) - 1)[into]
