"""Unwrapping of a mesh: few, large, nearly flat charts on the pages of a texture."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from texproj.arrays import Doubles
from texproj.errors import InputError
from texproj.mesh import Mesh, face_areas
from texproj.options import UnwrapOptions
from texproj.resources.memory import trim
from texproj.unwrap.atlas import Atlas
from texproj.unwrap.charts import Charts, extents, select, upright
from texproj.unwrap.flatten import flatten
from texproj.unwrap.packing import Placement
from texproj.unwrap.pages import atlas_of, first_scale, on_pages
from texproj.unwrap.parts import Regions
from texproj.unwrap.regions import dual_graph
from texproj.unwrap.stretch import flat_areas

EXPECTED_FILL = 0.75  # of the pages; the first guess where the resolution must be lowered
TILE_SHARE = 0.8  # of a page for each part of a chart that is longer than a page
SMALLEST_CHART_PX = 2.0  # so that every chart holds a texel center


def unwrap(
    mesh: Mesh,
    texels_per_unit: ArrayLike,
    options: UnwrapOptions | None = None,
    regions: Regions | None = None,
) -> Atlas:
    """An atlas of the whole mesh.

    regions: those of the mesh by the same options, if they are at hand.
    texels_per_unit: texels per mesh unit on the surface, > 0, one number or one for each face
    (F,); each chart gets the root of the area-weighted mean square of its faces. Where the
    pages are too few or too small, all charts shrink alike: stats.scale says how much.
    Raises InputError for a mesh without a face that has an area.
    """
    options = options or UnwrapOptions()
    if not face_areas(mesh).sum() > 0:
        raise InputError("The mesh has no faces with an area: give a mesh with a surface.")
    density = np.broadcast_to(np.asarray(texels_per_unit, np.float64), len(mesh.faces))
    regions = regions or Regions.of(mesh, options)
    flat, overlaps = flatten(mesh, regions, density, options)
    trim()
    charts = at_density(mesh, flat, density)
    charts, scale, placement = _fit(mesh, charts, options)
    return atlas_of(mesh, charts, placement, scale, overlaps, options)


def at_density(mesh: Mesh, charts: Charts, density: Doubles) -> Charts:
    """The charts in texels: each with as many as its surface asks for.

    density: (F,) texels per mesh unit.
    """
    area = face_areas(mesh)
    wanted = np.bincount(charts.chart_of_face, area * density**2, charts.count)
    flat = np.bincount(charts.chart_of_face, flat_areas(charts.uv, charts.faces), charts.count)
    factor = np.sqrt(wanted / np.maximum(flat, 1e-300))
    return replace(charts, uv=charts.uv * factor[charts.chart_of_uv, None])


def _fit(mesh: Mesh, charts: Charts, options: UnwrapOptions) -> tuple[Charts, float, Placement]:
    """The charts, those longer than a page cut; the largest scale <= 1 found at which they fit
    the pages; the placement.
    """
    room = options.page_size - 2 * options.padding_px
    scale = first_scale(charts, EXPECTED_FILL, options)
    if options.max_pages > 1:
        charts = _cut_long(mesh, charts, room / scale)
    longest = float(extents(charts.uv, charts.starts)[1].max())
    scale, placement = on_pages(partial(_scaled, charts), min(scale, room / longest), options)
    return charts, scale, placement


def _cut_long(mesh: Mesh, charts: Charts, longest: float) -> Charts:
    """Charts longer than `longest` texels cut along a grid, so that the rest need not shrink."""
    size = extents(charts.uv, charts.starts)[1]
    if size.max() <= longest:
        return charts
    tiles = np.where(size > longest, np.ceil(size / (TILE_SHARE * longest)), 1)
    middle = charts.uv[charts.faces].mean(axis=1)
    of_face = charts.chart_of_face
    tile = np.floor(middle / size[of_face] * tiles[of_face]).clip(0, tiles[of_face] - 1)
    key = np.column_stack([of_face, tile.astype(np.int64)])
    labels = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    return upright(select(charts, np.arange(len(labels)), dual_graph(mesh), labels))


def _scaled(charts: Charts, scale: float) -> Charts:
    size = extents(charts.uv, charts.starts)[1] * scale
    grow = np.maximum(1.0, SMALLEST_CHART_PX / np.maximum(size, 1e-9))
    return replace(charts, uv=charts.uv * (scale * grow)[charts.chart_of_uv])
