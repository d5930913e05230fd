"""The first guess at the charts of a surface: nearly flat regions, a large surface part by part, so
that memory grows with the parts and not with the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles, Rows
from texproj.mesh import Mesh, face_cross, norms
from texproj.options import UnwrapOptions
from texproj.resources.memory import trim
from texproj.unwrap.charts import plane_axes
from texproj.unwrap.halfedges import half_edges, opposite
from texproj.unwrap.regions import (
    DualGraph,
    connected,
    dual_graph,
    grow_regions,
    smoothed_normals,
    sum_by_label,
)

MOST_FACES = 1 << 20
"""Of what is worked on at once: some 300 MB."""

FLATNESS = 0.93
"""Least length of a chart's mean normal: lower gives fewer charts, more stretch."""

FLATNESS_IN_BLOCK = 0.98
"""The same of what grows within a block, which then goes on growing beyond."""

STEEPEST_DEG = 75.0
"""Largest angle between a face and the plane of its chart."""

SWAPS = 4
"""Rounds in which steep faces at a border may change to the neighbor."""


@dataclass(frozen=True, eq=False)
class Part:
    """Some regions of a surface. faces: (n,) of the mesh, ascending; graph: theirs, numbered in
    that order; labels: (n,) connected regions, 0..count-1.
    """

    faces: Rows
    graph: DualGraph
    labels: Rows


@dataclass(frozen=True, eq=False)
class Regions:
    """Nearly flat pieces of a surface.

    labels: (F,) region of each face; whole: the surface as one part, None where it is too large.
    """

    labels: Rows
    whole: Part | None

    @classmethod
    def of(cls, mesh: Mesh, options: UnwrapOptions) -> Regions:
        """The regions of the whole mesh."""
        if len(mesh.faces) > MOST_FACES:
            return cls(_grown_by_blocks(mesh), None)
        faces, graph = np.arange(len(mesh.faces), dtype=np.int32), dual_graph(mesh)
        normals = 0.5 * face_cross(mesh.vertices, mesh.faces)
        smooth = smoothed_normals(normals, graph)
        labels = grow_regions(smooth, norms(smooth), graph.pairs, graph.lengths, FLATNESS)
        labels = _less_steep(normals, graph, labels)
        return cls(labels, Part(faces, graph, labels))

    def parts(self, mesh: Mesh) -> Iterator[Part]:
        """Parts of about `MOST_FACES`, at least one region each, which hold each face once."""
        if self.whole is not None:
            yield self.whole
            return
        last = np.cumsum(np.bincount(self.labels))
        part_of_face = ((last - 1) // MOST_FACES).astype(np.int16)[self.labels]
        for number in np.unique(part_of_face):
            faces = np.flatnonzero(part_of_face == number).astype(np.int32)
            graph, normals = (
                dual_graph(mesh, faces),
                0.5 * face_cross(mesh.vertices, mesh.faces[faces]),
            )
            labels = np.unique(self.labels[faces], return_inverse=True)[1].astype(np.int64)
            yield Part(faces, graph, _less_steep(normals, graph, labels))


def _less_steep(normals: Doubles, graph: DualGraph, labels: Rows) -> Rows:
    """(n,) connected regions: steep faces at borders moved to the neighbor where they are less
    steep. normals: (n, 3) of length area.
    """
    limit = np.cos(np.radians(STEEPEST_DEG))
    axes = plane_axes(sum_by_label(normals, labels, int(labels.max()) + 1))[:, 2]
    area = norms(normals)
    both = np.concatenate([graph.pairs, graph.pairs[:, ::-1]])
    for _ in range(SWAPS):
        steep = np.einsum("ij,ij->i", normals, axes[labels]) < limit * area
        pairs = both[steep[both[:, 0]]]
        there = labels[pairs[:, 1]]
        cosine = np.einsum("ij,ij->i", normals[pairs[:, 0]], axes[there]) / area[pairs[:, 0]]
        order = np.argsort(cosine)
        order = order[cosine[order] > limit]
        labels[pairs[order, 0]] = there[order]
    return connected(labels, graph)


def _grown_by_blocks(mesh: Mesh) -> Rows:
    """(F,) regions grown within blocks, then from these on as if there were no blocks."""
    labels, count = np.empty(len(mesh.faces), np.int32), 0
    pairs, lengths, normals, areas, alone = [], [], [], [], []
    for rows in compact_blocks(mesh):
        block = _Block.of(mesh, rows)
        labels[rows] = block.labels + count
        own = ~block.graph.within(block.labels)
        pairs.append(block.labels[block.graph.pairs[own]] + count)
        lengths.append(block.graph.lengths[own])
        normals.append(block.sums[:, :3])
        areas.append(block.sums[:, 3])
        alone.append(np.stack([*block.alone[:2], labels[rows][block.alone[2]]]))
        count += len(block.sums)
        trim()
    start, end, region = np.concatenate(alone, axis=1)
    one, two = opposite(start, end, len(mesh.vertices))
    pairs.append(np.stack([region[one], region[two]], axis=1))
    lengths.append(norms(mesh.vertices[start[one]] - mesh.vertices[end[one]]))
    whole = np.concatenate(normals), np.concatenate(areas)
    grown = grow_regions(*whole, np.concatenate(pairs), np.concatenate(lengths), FLATNESS)
    return grown.astype(np.int32)[labels]


@dataclass(frozen=True, eq=False)
class _Block:
    """Regions of some faces. sums: (count, 4) smoothed normals and areas of each; alone: first and
    last vertex, and face, of each side that no other face of the block has.
    """

    graph: DualGraph
    labels: Rows
    sums: Doubles
    alone: tuple[Rows, Rows, Rows]

    @classmethod
    def of(cls, mesh: Mesh, rows: Rows) -> _Block:
        graph = dual_graph(mesh, rows)
        smooth = smoothed_normals(0.5 * face_cross(mesh.vertices, mesh.faces[rows]), graph)
        area = norms(smooth)
        given = smooth, area, graph.pairs, graph.lengths
        labels = grow_regions(*given, FLATNESS_IN_BLOCK)
        sums = sum_by_label(np.column_stack([smooth, area]), labels, int(labels.max()) + 1)
        start, end = half_edges(mesh.faces[rows])
        free = np.ones(len(start), bool)
        for inner in opposite(start, end, len(mesh.vertices)):
            free[inner] = False
        face = (np.flatnonzero(free) // 3).astype(np.int32)
        return cls(graph, labels, sums, (start[free], end[free], face))


def compact_blocks(mesh: Mesh) -> Iterator[Rows]:
    """The faces in boxes of at most `MOST_FACES`, each box halved along its longest side."""
    waiting = [np.arange(len(mesh.faces), dtype=np.int32)]
    while waiting:
        rows = waiting.pop()
        if len(rows) <= MOST_FACES:
            yield np.sort(rows)
            continue
        first = mesh.faces[rows, 0]
        sides = [np.ptp(mesh.vertices[first, axis]) for axis in range(3)]
        middle = len(rows) // 2
        order = np.argpartition(mesh.vertices[first, int(np.argmax(sides))], middle)
        waiting += [rows[order[middle:]], rows[order[:middle]]]
