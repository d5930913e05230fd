"""Find where a chart covers itself.

A chart without turned-over faces covers a point of the plane as often as its border winds around
that point, so it is enough to walk along rows and count the crossings of the border.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Rows
from texproj.unwrap.charts import Charts, border_edges, extents
from texproj.unwrap.halfedges import stable_order
from texproj.unwrap.regions import sum_by_label

MOST_ROWS = 8192  # per chart
SHORTEST = 1e-3  # of a row's height: shorter overlaps are rounding


def doubled(charts: Charts, row_height: Doubles) -> tuple[NDArray[np.bool_], Doubles]:
    """(n,) faces on the border of what is covered twice; (count,) area covered twice, exactly 0
    for charts that do not cover themselves.

    row_height: (count,) distance of the rows walked along, in the units of uv. Walks along x
    and along y: what is thinner than a row one way is long the other way.
    """
    edges = border_edges(charts)
    along_x, area_x = _doubled_in_rows(charts, edges, row_height)
    turned = charts.with_uv(charts.uv[:, ::-1] * [1, -1])
    along_y, area_y = _doubled_in_rows(turned, edges, row_height)
    return along_x | along_y, np.maximum(area_x, area_y)


def _doubled_in_rows(
    charts: Charts, edges: Rows, row_height: Doubles
) -> tuple[NDArray[np.bool_], Doubles]:
    edge, row, x, sign = _crossings(charts, edges, row_height)
    order = np.argsort(x, kind="stable")
    order = order[stable_order(row[order], int(row.max(initial=0)) + 1)]
    edge, x = edge[order], x[order]
    chart = charts.chart_of_uv[edges[edge, 0]]
    winding = np.cumsum(sign[order])
    length = np.diff(x, append=x[-1:])
    twice = np.flatnonzero((winding > 1) & (length > SHORTEST * row_height[chart]))
    touched = np.zeros(len(charts.uv), bool)
    touched[edges[edge[twice]]] = True
    touched[edges[edge[twice + 1]]] = True
    covered = (length * row_height[chart])[twice, None]
    area = sum_by_label(covered, chart[twice], charts.count)[:, 0]
    a, b, c = touched[charts.faces].T
    return (a & b) | (b & c) | (c & a), area


def _crossings(
    charts: Charts, edges: Rows, row_height: Doubles
) -> tuple[Rows, Rows, Doubles, Rows]:
    """Each crossing of a border edge and the middle of a row: edge, row (counted on from chart to
    chart), x, +1 where the inside begins (counter-clockwise borders run down there).
    """
    low, size = extents(charts.uv, charts.starts)
    height = np.maximum(np.maximum(row_height, size[:, 1] / MOST_ROWS), 1e-300)
    chart = charts.chart_of_uv[edges[:, 0]]
    y = charts.uv[edges, 1] / height[chart, None]
    first = np.ceil(np.minimum(*y.T) - 0.5).astype(np.int64)
    rows = np.ceil(np.maximum(*y.T) - 0.5).astype(np.int64) - first
    lowest = np.floor(low[:, 1] / height).astype(np.int64) - 1
    most = np.ceil(size[:, 1] / height).astype(np.int64) + 3
    counted = first + (np.cumsum(most) - most - lowest)[chart]
    edge = np.repeat(np.arange(len(edges)), rows)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(rows) - rows, rows)
    begin, rise = y[edge, 0], y[edge, 1] - y[edge, 0]
    t = (first[edge] + step + 0.5 - begin) / rise
    x = charts.uv[edges, 0][edge]
    sign = np.where(rise < 0, 1, -1)
    return edge, counted[edge] + step, x[:, 0] + t * (x[:, 1] - x[:, 0]), sign
