"""Unwrap a mesh: few, large, nearly flat charts on the pages of a texture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from texproj.color.atlas import Atlas, AtlasStats
from texproj.color.charts import Charts, extents, flat_regions, lay_flat
from texproj.color.packing import Placement, pack
from texproj.color.segmentation import Floats, Ints, dual_graph
from texproj.errors import InputError
from texproj.mesh import Mesh, face_areas
from texproj.options import UnwrapOptions

SMALLEST_CHART_PX = 2.0  # so that every chart holds a texel center


def unwrap(mesh: Mesh, texels_per_unit: ArrayLike, options: UnwrapOptions | None = None) -> Atlas:
    """An atlas of the whole mesh.

    texels_per_unit: texels per mesh unit on the surface, > 0, one number or one for each face
    (F,); each chart gets the root of the area-weighted mean square of its faces. Where the
    pages are too few or too small, all charts shrink alike: stats.scale says how much.
    Raises InputError for a mesh without faces.
    """
    options = options or UnwrapOptions()
    if len(mesh.faces) == 0:
        raise InputError("The mesh has no faces to unwrap: give a mesh with a surface.")
    regions = flat_regions(mesh, dual_graph(mesh), options)
    charts = lay_flat(mesh, regions)
    charts = _at_density(mesh, charts, np.asarray(texels_per_unit, np.float64))
    scale, placement = _fit(charts, options)
    return _atlas(mesh, charts, placement, options.padding_px, scale)


def _at_density(mesh: Mesh, charts: Charts, density: Floats) -> Charts:
    """The charts in texels: each with as many as its surface asks for."""
    area = face_areas(mesh)
    wanted = np.bincount(charts.chart_of_face, area * density**2, charts.count)
    flat = np.bincount(charts.chart_of_face, _flat_areas(charts.uv, charts.faces), charts.count)
    factor = np.sqrt(wanted / np.maximum(flat, 1e-300))
    return replace(charts, uv=charts.uv * factor[charts.chart_of_uv, None])


def _fit(charts: Charts, options: UnwrapOptions) -> tuple[float, Placement]:
    """The largest scale <= 1 found at which the charts fit the pages, and the placement."""
    room = options.page_size - 2 * options.padding_px
    longest = float(extents(charts.uv, charts.starts)[1].max())
    area = float(_flat_areas(charts.uv, charts.faces).sum())
    scale = min(1.0, room / longest, np.sqrt(0.95 * options.max_pages * room**2 / area))
    while True:
        placement = pack(_scaled(charts, scale), options.padding_px, options.page_size)
        if len(placement.page_sizes) <= options.max_pages:
            return scale, placement
        scale *= 0.93


def _scaled(charts: Charts, scale: float) -> Charts:
    size = extents(charts.uv, charts.starts)[1] * scale
    grow = np.maximum(1.0, SMALLEST_CHART_PX / np.maximum(size, 1e-9))
    return replace(charts, uv=charts.uv * (scale * grow)[charts.chart_of_uv])


def _atlas(mesh: Mesh, charts: Charts, placed: Placement, padding_px: int, scale: float) -> Atlas:
    texels = float(_flat_areas(placed.uv, charts.faces).sum())
    stretch, area = _stretch(mesh, placed.uv, charts), face_areas(mesh)
    median, p95 = _weighted_quantiles(stretch, area, (0.5, 0.95))
    pages = sum(w * h for w, h in placed.page_sizes)
    stats = AtlasStats(charts.count, median, p95, texels / pages, scale)
    return Atlas(
        uv_px=placed.uv,
        faces=charts.faces.astype(np.int32),
        vertex_of_uv=charts.vertex_of_uv.astype(np.int32),
        page_of_face=placed.page_of_chart[charts.chart_of_face].astype(np.int32),
        chart_of_face=charts.chart_of_face.astype(np.int32),
        page_sizes=placed.page_sizes,
        padding_px=padding_px,
        stats=stats,
    )


def _flat_areas(uv: Floats, faces: Ints) -> Floats:
    a, b, c = uv[faces].transpose(1, 0, 2)
    return 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def _stretch(mesh: Mesh, uv: Floats, charts: Charts) -> Floats:
    """(F,) ratio of the singular values of the map of each face to the texture, from its
    Gram matrices: the eigenvalues of inv(G_surface) @ G_texture are the squares.
    """
    x = _gram(mesh.vertices[mesh.faces])
    y = _gram(uv[charts.faces])
    determinant = np.maximum(x[0] * x[2] - x[1] ** 2, 1e-300)
    half_trace = 0.5 * (x[2] * y[0] - 2 * x[1] * y[1] + x[0] * y[2]) / determinant
    product = np.maximum(y[0] * y[2] - y[1] ** 2, 0) / determinant
    root = np.sqrt(np.maximum(half_trace**2 - product, 0))
    return np.sqrt((half_trace + root) / np.maximum(half_trace - root, 1e-12 * half_trace))


def _gram(corners: Floats) -> tuple[Floats, Floats, Floats]:
    p, q = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (p * p).sum(axis=1), (p * q).sum(axis=1), (q * q).sum(axis=1)


def _weighted_quantiles(values: Floats, weights: Floats, at: tuple[float, ...]) -> list[float]:
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    rows = np.searchsorted(share, np.array(at) * share[-1])
    return [float(values[order[min(row, len(order) - 1)]]) for row in rows]
