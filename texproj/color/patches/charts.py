"""Patches cut out of the photos and laid on pages, pixel for pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Rows
from texproj.camera import Camera
from texproj.color.patches.labels import Labels
from texproj.color.sampling.resolution import UNSEEN
from texproj.mesh import Mesh, face_normals
from texproj.options import UnwrapOptions
from texproj.unwrap.atlas import Atlas
from texproj.unwrap.chart_overlap import doubled
from texproj.unwrap.charts import Charts, extents, join
from texproj.unwrap.flatten import flatten
from texproj.unwrap.packing import Placement
from texproj.unwrap.pages import atlas_of, first_scale, on_pages
from texproj.unwrap.parts import Regions
from texproj.unwrap.regions import DualGraph, connected
from texproj.unwrap.unwrap import at_density

ROW_PX = 0.5
"""Distance of the rows in which overlaps are looked for."""

ROUNDS = 8
"""Rounds in which overlapping faces are cut off before each becomes a chart of its own."""

SMALLEST_PX = 2.0
"""Smaller patches are enlarged, so that each holds a texel center."""

LEVEL = 0.9
"""Cosine of the angle between faces up to which a photo of one goes on over the other."""

EXPECTED_FILL = 0.7
"""Part of the pages that patches cover; the first guess where they must shrink."""


def patch_atlas(
    mesh: Mesh,
    graph: DualGraph,
    cameras: Sequence[Camera],
    labels: Labels,
    density: NDArray[np.float32],
    options: UnwrapOptions,
) -> Atlas:
    """Every patch as its photo shows it, one texel per pixel and on the pixels' grid unless the
    pages are too small (then all shrink alike); faces without a photo as flat charts.

    labels: (F,) photo of each face, -1 = none; density: (F,) texels per mesh unit on the flat
    charts, 0 = unseen: a quarter of the median of the others.
    """
    room = options.page_size - 2 * options.padding_px
    seen, unseen = np.flatnonzero(labels >= 0), np.flatnonzero(labels < 0)
    parts: list[Charts] = []
    overlaps = 0
    if len(seen):
        parts, overlaps = _patches(mesh, cameras, labels, graph, room)
    if len(unseen):
        parts.append(_flat(mesh, unseen, density, options))
    charts, scale, placed = _fit(join(parts), options, room)
    return atlas_of(mesh, charts, placed, scale, overlaps, options)


def continued(mesh: Mesh, atlas: Atlas, graph: DualGraph) -> NDArray[np.bool_]:
    """(F,) faces at the border of a chart beyond which the surface goes on nearly flat, wherever
    the chart ends there: a photo may go on beyond the border.
    """
    one, two = graph.pairs.T
    normals = face_normals(mesh)
    level = np.einsum("ij,ij->i", normals[one], normals[two]) > LEVEL
    count = len(mesh.faces)
    neighbors = np.bincount(graph.pairs[level].ravel(), minlength=count)
    border = ~graph.within(atlas.chart_of_face.astype(np.int64))
    outer = np.bincount(graph.pairs[border].ravel(), minlength=count)
    return (outer > 0) & (neighbors == 3)


def _patches(
    mesh: Mesh, cameras: Sequence[Camera], labels: Labels, graph: DualGraph, room: int
) -> tuple[list[Charts], int]:
    """The patches of seen faces in pixels, lower left corners in the first pixel; how many had
    to be cut because they covered themselves.
    """
    faces = np.flatnonzero(labels >= 0)
    inner = graph.restricted(faces)
    key = _tiled(mesh, cameras, labels, room)[faces]
    finished: list[Charts] = []
    overlaps = 0
    for number in range(ROUNDS + 1):
        charts = _projected(mesh, cameras, faces, labels[faces], connected(key, inner))
        flipped = charts.with_uv(charts.uv * [1, -1])
        bad, twice = doubled(flipped, np.full(charts.count, ROW_PX))
        again = (twice > 0)[charts.chart_of_face]
        finished.append(_chosen(mesh, cameras, charts, labels, ~again))
        if not again.any():
            break
        overlaps += int(np.count_nonzero(twice > 0))
        faces, bad = faces[again], bad[again] | (number == ROUNDS - 1)
        inner = inner.restricted(np.flatnonzero(again))
        key = 2 * charts.chart_of_face[again] + bad
        if number == ROUNDS - 1:
            inner = DualGraph(inner.pairs[:0], inner.lengths[:0])
    return [part for part in finished if part.count], overlaps


def _chosen(
    mesh: Mesh,
    cameras: Sequence[Camera],
    charts: Charts,
    labels: Labels,
    kept: NDArray[np.bool_],
) -> Charts:
    faces = charts.face_of_mesh[kept]
    number = np.unique(charts.chart_of_face[kept], return_inverse=True)[1].ravel()
    return _projected(mesh, cameras, faces, labels[faces], number.astype(np.int64))


def _tiled(mesh: Mesh, cameras: Sequence[Camera], labels: Labels, room: int) -> Rows:
    """(F,) int64 labels; photos larger than a page are cut into squares that fit."""
    key = labels.astype(np.int64)
    for photo, camera in enumerate(cameras):
        if max(camera.width, camera.height) > room:
            faces = np.flatnonzero(labels == photo)
            xy = camera.project(mesh.vertices[mesh.faces[faces]].mean(axis=1))[0]
            tile = np.floor(np.nan_to_num(xy) / (0.8 * room)).astype(np.int64)
            key[faces] += len(cameras) * (1 + tile[:, 0] + 1000 * tile[:, 1])
    return key


def _projected(
    mesh: Mesh, cameras: Sequence[Camera], faces: Rows, photos: Labels, charts: Rows
) -> Charts:
    """Charts of some faces where their photos show them, pixels; charts: (n,) 0..count-1."""
    count = int(charts.max(initial=-1)) + 1
    corners = mesh.faces[faces].astype(np.int64)
    key = np.repeat(charts, 3) * len(mesh.vertices) + corners.ravel()
    unique, rows = np.unique(key, return_inverse=True)
    chart, vertex = unique // len(mesh.vertices), unique % len(mesh.vertices)
    photo_of_chart = np.zeros(count, np.int64)
    photo_of_chart[charts] = photos
    uv = np.zeros((len(unique), 2))
    for photo in np.unique(photos):
        own = photo_of_chart[chart] == photo
        uv[own] = cameras[photo].project(mesh.vertices[vertex[own]])[0]
    if count:
        low, _ = extents(uv, np.searchsorted(chart, np.arange(count)))
        uv -= np.floor(low)[chart]
    return Charts(uv, rows.reshape(-1, 3), vertex, chart, charts, faces, count)


def _flat(mesh: Mesh, faces: Rows, density: NDArray[np.float32], options: UnwrapOptions) -> Charts:
    """Flat charts of some faces, texels."""
    known = density[density > 0]
    typical = float(np.median(known)) if len(known) else 256 / max(mesh.diagonal, 1e-300)
    wanted = np.where(density > 0, density, UNSEEN * typical)[faces].astype(np.float64)
    rest = Mesh(mesh.vertices, mesh.faces[faces])
    flat, _ = flatten(rest, Regions.of(rest, options), wanted, options)
    return replace(at_density(rest, flat, wanted), face_of_mesh=faces)


def _fit(charts: Charts, options: UnwrapOptions, room: int) -> tuple[Charts, float, Placement]:
    """The charts at the largest scale <= 1 found at which they fit the pages, and their places."""
    size = extents(charts.uv, charts.starts)[1]
    grow = np.maximum(1.0, SMALLEST_PX / np.maximum(size.max(axis=1), 1e-9))
    charts = charts.with_uv(charts.uv * grow[charts.chart_of_uv, None])
    scale = first_scale(charts, EXPECTED_FILL, options)

    def flush(scale: float) -> Charts:
        scaled = charts.with_uv(charts.uv * scale)
        low, _ = extents(scaled.uv, scaled.starts)
        return scaled.with_uv(scaled.uv - low[scaled.chart_of_uv])

    scale, placed = on_pages(flush, min(scale, room / float(size.max() + 1)), options)
    scaled = charts.with_uv(charts.uv * scale)
    return scaled, scale, _on_grid(scaled, placed)


def _on_grid(charts: Charts, placed: Placement) -> Placement:
    """The placement moved by parts of a texel and without the packer's stretch, so that the texels
    of a patch at full size are pixels of its photo.
    """
    starts, chart = charts.starts, charts.chart_of_uv
    low, size = extents(charts.uv, starts)
    corner, grown = extents(placed.uv, starts)
    straight = (charts.uv - low[chart]) * (grown / np.maximum(size, 1e-9))[chart]
    turned = (charts.uv - low[chart])[:, ::-1] * (grown / np.maximum(size[:, ::-1], 1e-9))[chart]
    there = placed.uv - corner[chart]
    error = [
        np.maximum.reduceat(np.abs(there - uv).max(axis=1), starts) for uv in (straight, turned)
    ]
    swap = error[1] < error[0]
    uv = np.where(swap[chart, None], charts.uv[:, ::-1], charts.uv)
    low = np.where(swap[:, None], low[:, ::-1], low)
    return replace(placed, uv=uv + np.round(corner - low)[chart])
