"""One photo for each face: as good as possible, and in large patches.

A Potts model on the faces, minimized by alpha expansion (Boykov, Veksler, Zabih, "Fast approximate
energy minimization via graph cuts", PAMI 2001) with the maximum flow of SciPy. First for groups of
faces, then for smaller ones and at last for faces, each time only beside the seams found so far:
the flow of a whole surface would take minutes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from texproj.arrays import Bools, Floats, Ints
from texproj.color.patches.views import CONSENSUS_SCALE, OUTLIER, FaceViews
from texproj.mesh import Mesh, face_areas
from texproj.options import PatchOptions
from texproj.unwrap.regions import DualGraph, connected

GROUPS_PX = (40.0, 13.0)
"""Sizes of the groups of faces, from coarse to fine, pixels of the best photo."""

RINGS = 3
"""How far from a seam faces or groups may still change, in neighbors."""

CYCLES = 2
"""Rounds over all photos at most; a third changes nothing for the better."""

STEPS = 20.0
"""Integer steps of the energy per square pixel: SciPy's flow counts in integers."""

LARGEST = 1 << 26
"""Largest capacity, so that sums stay in 32 bits."""

FORBIDDEN = 3.0
"""Cost, in a group, of a face that the photo must not color: dearer than any that it may."""

AGREEING, DISAGREEING = 0.5, 4.5
"""Factors on what a seam costs, where the photos of a face agree and where they are far apart."""

Labels = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class _Problem:
    """Nodes (faces or groups of them) that want a photo each. Energies in `STEPS` per pixel.

    node, cost: (m,) the nodes that a photo may color and its cost there, photo after photo;
    parts: where those of each photo are; pairs: (E, 2) neighbors, weight: (E,) what it costs if
    they differ.
    """

    count: int
    node: Ints
    cost: Ints
    parts: dict[int, slice]
    pairs: Ints
    weight: Ints

    @classmethod
    def of(cls, views: FaceViews, area_px: Floats, pairs: Ints, seam: Floats) -> _Problem:
        """Every face a node."""
        face, rank = np.nonzero(views.photo >= 0)
        photo = views.photo[face, rank]
        order = np.argsort(photo.astype(np.uint16), kind="stable")  # short ones are sorted faster
        face, photo = face[order], photo[order]
        cost = _steps(views.cost[face, rank[order]] * area_px[face])
        return cls(len(area_px), face, cost, _runs(photo), pairs, _steps(seam))

    def grouped(self, group: Ints, area: Ints) -> _Problem:
        """Groups of faces as nodes; group: (F,) 0..n-1; area: (F,) steps."""
        count = int(group.max()) + 1
        ends = np.sort(group[self.pairs], axis=1)
        ends, weight = ends[ends[:, 0] != ends[:, 1]], self.weight[ends[:, 0] != ends[:, 1]]
        key, row = np.unique(ends @ np.array([count, 1]), return_inverse=True)
        pairs = np.stack([key // count, key % count], axis=1)
        weight = np.bincount(row, weight, len(key)).astype(np.int64)
        photo = np.concatenate([np.full(s.stop - s.start, p) for p, s in self.parts.items()])
        key, row = np.unique(photo * count + group[self.node], return_inverse=True)
        node = key % count
        shown = np.bincount(row, area[self.node], len(key))
        hidden = np.bincount(group, area, count)[node] - shown
        cost = np.bincount(row, self.cost, len(key)) + FORBIDDEN * hidden
        return _Problem(count, node, cost.astype(np.int64), _runs(key // count), pairs, weight)

    def cheapest(self) -> tuple[Labels, Ints]:
        """(n,) the best photo of each node for itself, -1 where none, and its cost."""
        best = np.full(self.count, np.iinfo(np.int64).max)
        labels = np.full(self.count, -1, np.int32)
        for photo, part in self.parts.items():
            better = self.cost[part] < best[self.node[part]]
            node = self.node[part][better]
            labels[node], best[node] = photo, self.cost[part][better]
        return labels, best

    def costs(self, labels: Labels) -> Ints:
        """(n,) cost of the photo of each node, 0 where it has none."""
        out = np.zeros(self.count, np.int64)
        for photo, part in self.parts.items():
            own = labels[self.node[part]] == photo
            out[self.node[part][own]] = self.cost[part][own]
        return out

    def beside_seams(self, labels: Labels) -> Bools:
        """(n,) nodes at most `RINGS` neighbors from another label."""
        near = np.zeros(self.count, bool)
        near[self.pairs[labels[self.pairs[:, 0]] != labels[self.pairs[:, 1]]]] = True
        return self._around(near)

    def _around(self, near: Bools) -> Bools:
        """(n,) nodes at most `RINGS` - 1 neighbors away from some."""
        near = near.copy()
        for _ in range(RINGS - 1):
            near[self.pairs[near[self.pairs].any(axis=1)]] = True
        return near

    def expanded(self, labels: Labels, free: Bools) -> Labels:
        """Better labels by alpha expansion; only `free` nodes change."""
        labels, current = labels.copy(), self.costs(labels)
        around = np.bincount(self.pairs.ravel(), np.repeat(self.weight, 2), self.count)
        for _ in range(CYCLES):
            changed = np.zeros(self.count, bool)
            for photo, part in self.parts.items():
                node, rise = self.node[part], self.cost[part] - current[self.node[part]]
                movable = free[node] & (labels[node] != photo) & (rise <= around[node])
                moved = self._expansion(labels, photo, node[movable], rise[movable])
                chosen = np.flatnonzero(movable)[moved]
                labels[node[chosen]] = photo
                current[node[chosen]] += rise[chosen]
                changed[node[chosen]] = True
            if np.count_nonzero(changed) <= self.count // 2000:
                break
            free = free & self._around(changed)
        return labels

    def _expansion(self, labels: Labels, photo: int, node: Ints, rise: Ints) -> Ints:
        """Which of the nodes change to `photo` in the best such move; rise: of their cost."""
        number = np.full(self.count, -1)
        number[node] = np.arange(len(node))
        touched = (number[self.pairs] >= 0).any(axis=1)
        pairs, weight = self.pairs[touched], self.weight[touched]
        i, j = number[pairs].T
        both = (i >= 0) & (j >= 0)
        before = np.where(labels[pairs[:, 0]] != labels[pairs[:, 1]], weight, 0)
        gain = rise.astype(np.float64)
        # Both free, with A, B, C, D the pair's energy for none, j, i, both moved: A + (C - A) i
        # + (D - C) j + (B + C - A - D) (1 - i) j; here A = w or 0, B = C = w, D = 0.
        gain += np.bincount(i[both], (weight - before)[both], len(node))
        gain -= np.bincount(j[both], weight[both], len(node))
        for one, other in ((i, 1), (j, 0)):
            alone = (one >= 0) & ~both
            after = np.where(labels[pairs[:, other]] == photo, 0, weight)
            gain += np.bincount(one[alone], (after - before)[alone], len(node))
        return _cut(gain.astype(np.int64), i[both], j[both], (2 * weight - before)[both])


def choose_photos(mesh: Mesh, views: FaceViews, graph: DualGraph, options: PatchOptions) -> Labels:
    """(F,) photo of each face, -1 where none shows it.

    The energy is, in pixels of the best photo, the sum of cost times area over the faces plus
    `seam_px` times the length of all seams: a seam is worth as much as a strip of that width at
    cost 1; less where the photos agree, more where they do not.
    """
    labels = views.photo[:, 0].copy()
    if not views.seen.any():
        return labels
    area_px = (face_areas(mesh) * views.density.astype(np.float64) ** 2).astype(np.float32)
    real = views.seen[graph.pairs].all(axis=1)
    seam = options.seam_px * graph.lengths * views.density[graph.pairs].mean(axis=1)
    apart = disagreement(views).clip(0, DISAGREEING - AGREEING)
    seam *= AGREEING + apart[graph.pairs].mean(axis=1)
    faces = _Problem.of(views, area_px, graph.pairs[real], seam[real])
    for number, size in enumerate(GROUPS_PX):
        group = _grouped(mesh, views, graph, size)
        groups = faces.grouped(group, _steps(area_px))
        start, free = groups.cheapest()[0], np.ones(groups.count, bool)
        if number > 0:
            start = _majority(group, labels, area_px)
            free = groups.beside_seams(start)
        found = groups.expanded(start, free)[group]
        labels = np.where((views.photo == found[:, None]).any(axis=1), found, views.photo[:, 0])
    return faces.expanded(labels, faces.beside_seams(labels))


def disagreement(views: FaceViews) -> Floats:
    """(F,) root mean square difference of a face's photos from what they agree on, in
    `consensus_scale`; one that shows something else counts `outlier` of these.
    """
    known = np.count_nonzero(views.photo >= 0, axis=1)
    outliers = np.count_nonzero(views.outlier >= 0, axis=1)
    square = np.float32(OUTLIER**2) * outliers.astype(np.float32)
    for rank in range(views.photo.shape[1]):
        way = views.to_consensus[:, rank].astype(np.float32)
        square += np.einsum("fc,fc->f", way, way) / np.float32(3 * CONSENSUS_SCALE**2)
    return np.sqrt(square / np.maximum(known + outliers, 1)).astype(np.float32)


def _steps(energy: NDArray[np.floating]) -> Ints:
    return np.round(np.clip(STEPS * energy.astype(np.float64), 0, LARGEST)).astype(np.int64)


def _runs(sorted_values: NDArray[np.integer]) -> dict[int, slice]:
    """Where each value is in a sorted array."""
    values, starts = np.unique(sorted_values, return_index=True)
    stops = np.append(starts[1:], len(sorted_values))
    return {int(v): slice(a, b) for v, a, b in zip(values, starts, stops, strict=True)}


def _grouped(mesh: Mesh, views: FaceViews, graph: DualGraph, size_px: float) -> Ints:
    """(F,) connected groups of faces in cubes of about `size_px` pixels of the best photo."""
    typical = float(np.median(views.density[views.seen]))
    center = (mesh.vertices - mesh.center)[mesh.faces].mean(axis=1)
    cube = np.floor(center * (typical / size_px)).astype(np.int64)
    cube -= cube.min(axis=0)
    sides = cube.max(axis=0) + 2
    key = (cube[:, 0] * sides[1] + cube[:, 1]) * sides[2] + cube[:, 2]
    return connected(2 * key + views.seen, graph)


def _majority(group: Ints, labels: Labels, area_px: Floats) -> Labels:
    """(n,) the label with the largest area in each group."""
    most = int(labels.max()) + 2
    key, row = np.unique(group * most + labels + 1, return_inverse=True)
    order = np.argsort(np.bincount(row, area_px, len(key)), kind="stable")
    out = np.full(int(group.max()) + 1, -1, np.int32)
    out[key[order] // most] = key[order] % most - 1
    return out


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
