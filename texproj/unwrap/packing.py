"""Place charts on pages with xatlas, at the resolution of coarse cells."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xatlas
from numpy.typing import NDArray

from texproj.arrays import Doubles, Rows
from texproj.errors import RenderError
from texproj.mesh import by_blocks
from texproj.unwrap.charts import Charts, extents
from texproj.unwrap.covers import cover
from texproj.unwrap.halfedges import stable_order
from texproj.unwrap.stretch import flat_areas

SMALL_PX, TRAY_PX = 32.0, 256  # longest chart that goes on a tray, side of a tray
LARGE_PX = 2.0e7  # square texels
NARROW_CELLS = 2.0  # charts narrower than this are packed as rectangles
SMALLEST_FACE = 1e-5  # square cells; xatlas leaves out faces below FLT_EPSILON and their charts


@dataclass(frozen=True, eq=False)
class Placement:
    """Where charts lie on the pages.

    uv: (W, 2) float64 texels on the page of each chart; page_of_chart: (n,) int64;
    page_sizes: (width, height) of each page.
    """

    uv: Doubles
    page_of_chart: Rows
    page_sizes: tuple[tuple[int, int], ...]


def pack(charts: Charts, padding_px: int, page_size: int) -> Placement:
    """Places on pages of at most page_size, at least padding_px texels between charts.

    charts: in texels, lower left corners at the origin, none longer than page_size - padding.
    xatlas grows each chart to whole cells (half a padding; a whole one for large textures, for
    speed) and may mirror it.
    """
    area = float(flat_areas(charts.uv, charts.faces).sum())
    cell = max(1, padding_px if area > LARGE_PX else padding_px // 2)
    gap = -(-padding_px // cell)
    trays, rows, boxed = _on_trays(charts, padding_px, page_size)
    boxed |= extents(trays.uv, trays.starts)[1].min(axis=1) < NARROW_CELLS * cell
    few = len(charts.faces) < area / cell**2
    for _ in range(5):
        proxy = _of_faces(trays, cell, boxed) if few else _of_cells(trays, cell, boxed)
        placed = _run(proxy, gap, page_size // cell)
        uv, page, failed = _transfer(trays, cell, proxy, placed)
        if not failed.any():
            page_of_uv = page[trays.chart_of_uv]
            return _finish(charts, (uv * cell)[rows], page_of_uv[rows], -(-gap * cell // 2))
        boxed |= failed
    raise RenderError("xatlas could not place all charts: lower the texture resolution")


@dataclass(frozen=True, eq=False)
class _Proxy:
    """What xatlas packs: (P, 2) uv in cells, faces into them, chart of each row (ascending); apart:
    (n, 2) where each chart is handed over, since xatlas takes corners at equal places for the same.
    """

    uv: Doubles
    faces: Rows
    chart: Rows
    apart: Doubles


@dataclass(frozen=True, eq=False)
class _Placed:
    uv: Doubles  # (P, 2) cells
    page: Rows  # (P,)


def _of_cells(charts: Charts, cell: int, boxed: NDArray[np.bool_]) -> _Proxy:
    """The cells that charts touch, where there are fewer of them than faces, side by side."""
    size = extents(charts.uv, charts.starts)[1] / cell
    size[boxed] = np.maximum(size[boxed], NARROW_CELLS)
    cells = cover(charts, cell, size, boxed)
    starts = np.searchsorted(cells.chart, np.arange(charts.count))
    width = np.maximum.reduceat(cells.uv[:, 0], starts) + 1
    apart = np.stack([np.cumsum(width) - width, np.zeros(len(width))], axis=1)
    return _Proxy(cells.uv, cells.faces, cells.chart, apart)


def _of_faces(charts: Charts, cell: int, boxed: NDArray[np.bool_]) -> _Proxy:
    """The faces that xatlas can see, and a rectangle for each narrow chart; each chart shifted by
    less than a cell.
    """
    uv = charts.uv / cell
    area = flat_areas(uv, charts.faces)
    seen = (area > SMALLEST_FACE) & ~boxed[charts.chart_of_face]
    boxed = ~np.isin(np.arange(charts.count), charts.chart_of_face[seen])
    rows, flat = np.unique(charts.faces[seen], return_inverse=True)
    box = np.maximum(extents(uv, charts.starts)[1][boxed], NARROW_CELLS)
    corners = box[:, None, :] * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    quad = len(rows) + 4 * np.arange(len(box))[:, None] + np.array([0, 1, 2, 0, 2, 3])
    faces = np.concatenate([flat.reshape(-1, 3), quad.reshape(-1, 3)])
    chart = np.concatenate([charts.chart_of_uv[rows], np.repeat(np.flatnonzero(boxed), 4)])
    order = np.argsort(chart, kind="stable")
    where = np.argsort(order)
    uv = np.concatenate([uv[rows], corners.reshape(-1, 2)])[order]
    apart = np.arange(charts.count)[:, None] * np.array([0.6180339887, 0.7548776662]) % 1
    return _Proxy(uv, where[faces], chart[order], apart)


def _run(proxy: _Proxy, gap: int, page_cells: int) -> _Placed:
    """One page as small as xatlas makes it, or several of page_cells if that is too large."""
    if flat_areas(proxy.uv, proxy.faces).sum() < page_cells**2:
        placed, width, height = _xatlas(proxy, gap, 0)
        if max(width, height) + gap <= page_cells:
            return placed
    return _xatlas(proxy, gap, page_cells - gap)[0]


def _xatlas(proxy: _Proxy, gap: int, resolution: int) -> tuple[_Placed, int, int]:
    """Positions, width and height in cells."""
    atlas = xatlas.Atlas()
    uv = proxy.uv + proxy.apart[proxy.chart]
    atlas.add_uv_mesh(uv.astype(np.float32), proxy.faces.astype(np.uint32))
    options = xatlas.PackOptions()
    options.texels_per_unit = 1.0
    options.resolution = resolution
    options.padding = gap
    options.bruteForce = False
    options.rotate_charts_to_axis = False
    atlas.generate(xatlas.ChartOptions(), options)
    rows, _, uv = atlas.get_mesh(0)
    page, _ = atlas.get_mesh_vertex_assignment(0)
    back = np.empty(len(proxy.uv), np.int64)
    back[rows] = np.arange(len(rows))
    texels = uv.astype(np.float64) * [atlas.width, atlas.height]
    placed = _Placed(texels[back], page.astype(np.int64)[back])
    return placed, atlas.width, atlas.height


def _transfer(
    charts: Charts, cell: int, proxy: _Proxy, placed: _Placed
) -> tuple[Doubles, Rows, NDArray[np.bool_]]:
    """All uv in cells under the map of each chart's proxy; page of each chart; which failed.

    xatlas turns a chart by exchanging x and y, then stretches each side by less than a cell.
    """
    starts = np.searchsorted(proxy.chart, np.arange(charts.count))
    low, size = extents(proxy.uv, starts)
    new_low, new_size = extents(placed.uv, starts)
    fits = []
    for swap in (False, True):
        order = [1, 0] if swap else [0, 1]
        scale = new_size / size[:, order]
        mapped = (proxy.uv - low[proxy.chart])[:, order] * scale[proxy.chart] + new_low[proxy.chart]
        error = np.maximum.reduceat(np.abs(mapped - placed.uv).max(axis=1), starts)
        growth = np.abs(new_size - size[:, order]).max(axis=1)
        fits.append((error, growth, scale))
    (e0, g0, s0), (e1, g1, s1) = fits
    swapped = np.where(np.abs(e0 - e1) > 0.01, e1 < e0, g1 < g0)
    scale = np.where(swapped[:, None], s1, s0)
    growth, error = np.where(swapped, g1, g0), np.where(swapped, e1, e0)

    def moved(rows: slice) -> Doubles:
        chart = charts.chart_of_uv[rows]
        uv = charts.uv[rows] / cell - low[chart]
        uv = np.where(swapped[chart, None], uv[:, ::-1], uv)
        return uv * scale[chart] + new_low[chart]

    uv = by_blocks(len(charts.uv), moved)
    return uv, placed.page[starts], (error > 0.01) | (growth > 1.001)


def _finish(charts: Charts, uv: Doubles, page_of_uv: Rows, border: int) -> Placement:
    uv = uv + border
    sizes = []
    page_of_chart = page_of_uv[charts.starts]
    corner = np.maximum.reduceat(uv, charts.starts)
    for number in range(int(page_of_chart.max()) + 1):
        width, height = np.ceil(corner[page_of_chart == number].max(axis=0)).astype(int) + border
        sizes.append((int(width), int(height)))
    return Placement(uv, page_of_chart, tuple(sizes))


def _on_trays(
    charts: Charts, padding_px: int, page_size: int
) -> tuple[Charts, Rows, NDArray[np.bool_]]:
    """Small charts laid on common trays, which then count as one chart each.

    xatlas tries positions at random, which takes long for thousands of specks. Returns the
    charts and trays, the row in them of each row of charts.uv, and which are trays.
    """
    size = extents(charts.uv, charts.starts)[1]
    small = np.flatnonzero(size.max(axis=1) <= min(SMALL_PX, page_size / 8))
    tray, corner = _shelves(size[small] + padding_px, min(TRAY_PX, page_size // 2))
    own = np.delete(np.arange(charts.count), small)
    bundle = np.empty(charts.count, np.int32)
    bundle[own] = np.arange(len(own))
    bundle[small] = len(own) + tray
    count = len(own) + int(tray.max(initial=-1)) + 1
    offset = np.zeros((charts.count, 2))
    offset[small] = corner
    of_uv = bundle[charts.chart_of_uv]
    order = stable_order(of_uv, count)
    rows = np.empty(len(order), np.int32)
    rows[order] = np.arange(len(order), dtype=np.int32)
    moved = replace(
        charts,
        uv=charts.uv[order] + offset[charts.chart_of_uv[order]],
        faces=rows[charts.faces],
        vertex_of_uv=charts.vertex_of_uv[order],
        chart_of_uv=of_uv[order],
        chart_of_face=bundle[charts.chart_of_face],
        count=count,
    )
    return moved, rows, np.arange(count) >= len(own)


def _shelves(size: Doubles, side: float) -> tuple[Rows, Doubles]:
    """(n,) tray and (n, 2) corner of rectangles in rows on square trays, tallest first."""
    tray = np.zeros(len(size), np.int64)
    corner = np.zeros((len(size), 2))
    number, x, y, height = 0, 0.0, 0.0, 0.0
    for i in np.argsort(-size[:, 1], kind="stable"):
        if x + size[i, 0] > side:
            x, y, height = 0.0, y + height, 0.0
        if y + size[i, 1] > side:
            number, x, y, height = number + 1, 0.0, 0.0, 0.0
        tray[i], corner[i] = number, (x, y)
        x, height = x + size[i, 0], max(height, size[i, 1])
    return tray, corner
