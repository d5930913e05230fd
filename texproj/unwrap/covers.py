"""Charts as the square cells that they touch: runs of cells, and few triangles that cover these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Bools, Doubles, Rows
from texproj.mesh import blocks
from texproj.unwrap.charts import Charts
from texproj.unwrap.halfedges import stable_order
from texproj.unwrap.texel_faces import ranges


@dataclass(frozen=True, eq=False)
class Runs:
    """Cells side by side, in the order of rows, then of columns. row: (n,) counted on from chart to
    chart; start, stop: (n,) columns.
    """

    row: Rows
    start: Rows
    stop: Rows

    @classmethod
    def joined(cls, row: Rows, start: Rows, stop: Rows, rows: int) -> Runs:
        """Runs in any order, those that meet or overlap as one; rows: how many there are."""
        order = np.argsort(start, kind="stable")
        order = order[stable_order(row[order], rows)]
        row, start, stop = row[order], start[order], stop[order]
        width = int(stop.max(initial=0)) + 1
        reach = np.maximum.accumulate(row * width + stop) - row * width
        new = np.ones(len(row), bool)
        new[1:] = (row[1:] != row[:-1]) | (start[1:] > reach[:-1])
        first = np.flatnonzero(new)
        last = np.append(first, len(row))[1:] - 1
        return cls(row[first], start[first], reach[last])


@dataclass(frozen=True, eq=False)
class Cover:
    """Triangles that cover the cells of charts, and nothing else; those of a chart hang together
    by whole edges where its cells do. uv: (P, 2) corners of cells; faces: (T, 3) rows of uv,
    counter-clockwise; chart: (P,) ascending.
    """

    uv: Doubles
    faces: Rows
    chart: Rows


def cover(charts: Charts, cell: int, size: Doubles, boxed: Bools) -> Cover:
    """The cells that charts touch. charts: in texels, lower left corners at the origin; cell:
    texels; size: (count, 2) of the charts, cells; boxed: (count,) charts that take all cells of
    their rectangles.
    """
    columns, height = np.maximum(np.ceil(size), 1).astype(np.int64).T
    height[~boxed] += 1  # a corner that rounding puts on the upper border
    first = np.cumsum(height) - height
    parts = [_rectangles(columns[boxed], height[boxed], first[boxed])]
    for some in blocks(len(charts.faces)):
        own = np.flatnonzero(~boxed[charts.chart_of_face[some]]) + some.start
        corners = charts.uv[charts.faces[own]] / cell
        parts.append(_touched(corners, first[charts.chart_of_face[own]], int(height.sum())))
    row = np.concatenate([part.row for part in parts])
    start = np.concatenate([part.start for part in parts])
    stop = np.concatenate([part.stop for part in parts])
    runs = Runs.joined(row, start, stop, int(height.sum()))
    return _triangles(runs, np.repeat(np.arange(len(height)), height), first)


def _rectangles(columns: Rows, height: Rows, first: Rows) -> Runs:
    owner, row = ranges(first, first + height)
    return Runs(row, np.zeros(len(row), np.int64), columns[owner])


def _touched(corners: Doubles, first: Rows, rows: int) -> Runs:
    """The cells that triangles (f, 3, 2) touch. first: (f,) number of the row at height 0."""
    y = corners[..., 1]
    low = np.floor(y.min(axis=1)).astype(np.int64)
    high = np.maximum(np.ceil(y.max(axis=1)).astype(np.int64), low + 1)
    owner, row = ranges(low, high)
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for i in range(3):
        a, b = corners[owner, i], corners[owner, (i + 1) % 3]
        rise = b[:, 1] - a[:, 1]
        slope = (b[:, 0] - a[:, 0]) / np.where(rise == 0, np.inf, rise)
        bottom, top = np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
        there = (bottom <= row + 1) & (top >= row)
        for y_in in (np.clip(row, bottom, top), np.clip(row + 1, bottom, top)):
            x = a[:, 0] + (y_in - a[:, 1]) * slope
            left = np.where(there, np.minimum(left, x), left)
            right = np.where(there, np.maximum(right, x), right)
    start = np.maximum(np.floor(left), 0).astype(np.int64)
    stop = np.maximum(np.ceil(right).astype(np.int64), start + 1)
    return Runs.joined(first[owner] + row, start, stop, rows)


def _triangles(runs: Runs, chart_of_row: Rows, first: Rows) -> Cover:
    """Each run between the ends of all runs at its lower and its upper border."""
    chart = chart_of_row[runs.row]
    lower = runs.row + chart  # a chart has one border more than rows
    width = int(runs.stop.max(initial=0)) + 1
    ends = [(line * width + x) for line in (lower, lower + 1) for x in (runs.start, runs.stop)]
    points = np.unique(np.concatenate(ends))
    b0, b1, a0, a1 = (np.searchsorted(points, end) for end in ends)
    below, k = ranges(b0, b1)
    above, j = ranges(a0, a1)
    faces = [np.stack([k, k + 1, a0[below]], axis=1), np.stack([j + 1, j, b1[above]], axis=1)]
    line, x = points // width, points % width
    line_starts = first + np.arange(len(first))
    chart = np.searchsorted(line_starts, line, side="right") - 1
    uv = np.stack([x, line - line_starts[chart]], axis=1).astype(np.float64)
    return Cover(uv, np.concatenate(faces), chart)
