"""Charts on as many pages as are allowed, and the atlas that this makes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from texproj.mesh import Mesh, by_blocks, face_areas
from texproj.options import UnwrapOptions
from texproj.unwrap.atlas import Atlas, AtlasStats
from texproj.unwrap.charts import Charts
from texproj.unwrap.packing import Placement, pack
from texproj.unwrap.stretch import flat_areas, stretch, weighted_quantiles

SMALLER = 0.95
"""Factor on the scale from one try to the next."""


def first_scale(charts: Charts, fill: float, options: UnwrapOptions) -> float:
    """The scale <= 1 at which charts that cover the part `fill` of the pages just fit them."""
    room = options.page_size - 2 * options.padding_px
    area = float(flat_areas(charts.uv, charts.faces).sum())
    return min(1.0, float(np.sqrt(fill * options.max_pages * room**2 / area)))


def on_pages(
    scaled: Callable[[float], Charts], scale: float, options: UnwrapOptions
) -> tuple[float, Placement]:
    """The first scale, from `scale` downwards, at which the charts fit the pages, and their places.

    scaled: the charts at a scale, lower left corners at the origin, none longer than a page.
    """
    while True:
        placed = pack(scaled(scale), options.padding_px, options.page_size)
        if len(placed.page_sizes) <= options.max_pages:
            return scale, placed
        scale *= SMALLER


def atlas_of(
    mesh: Mesh,
    charts: Charts,
    placed: Placement,
    scale: float,
    overlaps: int,
    options: UnwrapOptions,
) -> Atlas:
    """The atlas of placed charts of a whole mesh. scale, overlaps: see `AtlasStats`."""
    ratio = by_blocks(
        len(mesh.faces),
        lambda rows: stretch(mesh.vertices[mesh.faces[rows]], placed.uv[charts.faces[rows]]),
    )
    median, p95 = weighted_quantiles(ratio, face_areas(mesh), (0.5, 0.95))
    texels = float(flat_areas(placed.uv, charts.faces).sum())
    packed = texels / sum(w * h for w, h in placed.page_sizes)
    return Atlas(
        uv_px=placed.uv,
        faces=charts.faces.astype(np.int32),
        vertex_of_uv=charts.vertex_of_uv.astype(np.int32),
        page_of_face=placed.page_of_chart[charts.chart_of_face].astype(np.int32),
        chart_of_face=charts.chart_of_face.astype(np.int32),
        page_sizes=placed.page_sizes,
        padding_px=options.padding_px,
        stats=AtlasStats(charts.count, median, p95, packed, scale, overlaps),
    )
