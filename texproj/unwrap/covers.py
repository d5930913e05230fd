"""Charts as the square cells that they touch: few triangles that cover these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Bools, Doubles, Rows
from texproj.mesh import blocks
from texproj.unwrap.charts import Charts
from texproj.unwrap.texel_faces import ranges


@dataclass(frozen=True, eq=False)
class Cover:
    """Triangles that cover the cells of charts, and nothing else; those of a chart hang together
    by whole edges where its cells do. uv: (P, 2) corners of cells; faces: (T, 3) rows of uv,
    counter-clockwise; chart: (P,) ascending.
    """

    uv: Doubles
    faces: Rows
    chart: Rows


@dataclass(frozen=True, eq=False)
class _Grids:
    """One image of cells for each chart, all in one array. columns, rows: (n,) of each, with an
    empty column beside; first: (n,) place of its first cell; cells: whether it is touched.
    """

    columns: Rows
    rows: Rows
    first: Rows
    cells: Bools

    @classmethod
    def empty(cls, size: Doubles) -> _Grids:
        columns, rows = np.maximum(np.ceil(size), 1).astype(np.int64).T + np.array([[1], [0]])
        last = np.cumsum(columns * rows)
        return cls(columns, rows, last - columns * rows, np.zeros(int(last[-1]), bool))

    def fill(self, chart: Rows, row: Rows, start: Rows, stop: Rows) -> None:
        """Touch the cells from column start to stop, as far as the charts have them."""
        row = np.minimum(row, self.rows[chart] - 1)
        start = np.minimum(start, self.columns[chart] - 2)
        stop = np.clip(stop, start + 1, self.columns[chart] - 1)
        at = self.first[chart] + row * self.columns[chart]
        self.cells[ranges(at + start, at + stop)[1]] = True

    def runs(self) -> tuple[Rows, Rows, Rows, Rows]:
        """Touched cells side by side, in order: chart, row, start and stop columns."""
        step = np.diff(self.cells.view(np.int8), prepend=0)
        start, stop = np.flatnonzero(step == 1), np.flatnonzero(step == -1)
        chart = np.searchsorted(self.first, start, side="right") - 1
        row, column = np.divmod(start - self.first[chart], self.columns[chart])
        return chart, row, column, column + stop - start


def cover(charts: Charts, cell: int, size: Doubles, boxed: Bools) -> Cover:
    """The cells that charts touch. charts: in texels, lower left corners at the origin; cell:
    texels; size: (count, 2) of the charts, cells; boxed: (count,) charts that take all cells of
    their rectangles.
    """
    grids = _Grids.empty(size)
    chart, row = ranges(np.zeros(len(size), np.int64), np.where(boxed, grids.rows, 0))
    grids.fill(chart, row, np.zeros(len(row), np.int64), grids.columns[chart])
    for some in blocks(len(charts.faces)):
        own = np.flatnonzero(~boxed[charts.chart_of_face[some]]) + some.start
        face, *cells = _touched(charts.uv[charts.faces[own]] / cell)
        grids.fill(charts.chart_of_face[own][face], *cells)
    return _triangles(*grids.runs(), grids.rows)


def _touched(corners: Doubles) -> tuple[Rows, Rows, Rows, Rows]:
    """The cells that triangles (f, 3, 2) touch: triangle, row, start and stop columns."""
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
        for border in (row, row + 1):
            x = a[:, 0] + (np.clip(border, bottom, top) - a[:, 1]) * slope
            left = np.where(there, np.minimum(left, x), left)
            right = np.where(there, np.maximum(right, x), right)
    start = np.maximum(np.floor(left), 0).astype(np.int64)
    return owner, row, start, np.ceil(right).astype(np.int64)


def _triangles(chart: Rows, row: Rows, start: Rows, stop: Rows, rows: Rows) -> Cover:
    """Each run of cells between the ends of all runs at its lower and its upper border. rows: of
    each chart.
    """
    first = np.cumsum(rows + 1) - (rows + 1)  # borders of the charts before
    lower, width = first[chart] + row, int(stop.max()) + 1
    ends = [line * width + x for line in (lower, lower + 1) for x in (start, stop)]
    points = np.unique(np.concatenate(ends))
    b0, b1, a0, a1 = (np.searchsorted(points, end) for end in ends)
    below, k = ranges(b0, b1)
    above, j = ranges(a0, a1)
    faces = [np.stack([k, k + 1, a0[below]], axis=1), np.stack([j + 1, j, b1[above]], axis=1)]
    line, x = points // width, points % width
    of_point = np.searchsorted(first, line, side="right") - 1
    uv = np.stack([x, line - first[of_point]], axis=1).astype(np.float64)
    return Cover(uv, np.concatenate(faces), of_point)
