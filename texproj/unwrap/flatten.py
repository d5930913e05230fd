"""From a mesh to charts without folds, overlaps or faces that are stretched too much."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Bools, Doubles, Rows
from texproj.mesh import Mesh, by_blocks, face_areas, face_cross, norms
from texproj.options import UnwrapOptions
from texproj.resources.memory import trim
from texproj.unwrap.chart_overlap import doubled
from texproj.unwrap.charts import (
    Charts,
    border_edges,
    join,
    plane_axes,
    project,
    select,
    upright,
)
from texproj.unwrap.parts import FLATNESS, STEEPEST_DEG, Part, Regions
from texproj.unwrap.regions import DualGraph, connected, grow_regions, sum_by_label
from texproj.unwrap.stretch import signed_area, stretch

RELAXATIONS = 4  # rounds in which corners of folded faces move between their neighbors
SMALL_OVERLAP = 0.03  # of a chart's area: less is peeled from its border, more halves the chart
PEELS = 6  # rounds in which overlaps are peeled from their borders before a chart is halved
MOST_ROUNDS = 40  # then every face left becomes a chart


def flatten(
    mesh: Mesh, regions: Regions, density: Doubles, options: UnwrapOptions
) -> tuple[Charts, int]:
    """Charts of all faces, in mesh units, upright, and how many had to be cut for overlaps.

    density: (F,) texels per mesh unit: overlaps are looked for in steps of half a texel.
    Every region is projected along its mean normal; corners of folded faces are moved between
    their neighbors; what is still folded, steeper than `STEEPEST_DEG` or covered twice is
    cut off and forms regions among itself.
    """
    area, overlaps = face_areas(mesh), 0
    finished: list[Charts] = []
    for part in regions.parts(mesh):
        overlaps += _flatten_part(mesh, part, area, density, finished)
        trim()
    return join(finished), overlaps


def _flatten_part(
    mesh: Mesh, part: Part, area: Doubles, density: Doubles, finished: list[Charts]
) -> int:
    """Append the upright charts of a part; how many had to be cut for overlaps."""
    faces, graph, labels, overlaps = part.faces, part.graph, part.labels, 0
    for number in range(MOST_ROUNDS):
        charts, bad = _unfolded(mesh, area, project(mesh, faces, labels))
        kept = np.flatnonzero(~bad)
        inner = graph.restricted(kept)
        flat = select(charts, kept, inner)  # folded faces would wind backwards
        at_border, twice = doubled(flat, _row_height(flat, area, density))
        layered = (twice > 0)[flat.chart_of_face]
        single = np.flatnonzero(~layered)
        done = select(flat, single, inner.restricted(single)) if layered.any() else flat
        if done.count:
            finished.append(upright(done))
        total = np.bincount(flat.chart_of_face, area[flat.face_of_mesh], flat.count)
        halve = twice > (SMALL_OVERLAP * total if number < PEELS else 0)
        labels = np.zeros(len(faces), np.int64)
        labels[kept] = _halved(mesh, flat, halve)
        again = bad.copy()
        again[kept] = layered
        bad[kept] = at_border & ~halve[flat.chart_of_face]
        if not again.any():
            break
        overlaps += int(np.count_nonzero(twice))
        rows = np.flatnonzero(again)
        graph, faces = graph.restricted(rows), faces[rows]
        labels = _cut_off(mesh, faces, labels[rows], bad[rows], graph)
    else:
        finished.append(upright(project(mesh, faces, np.arange(len(faces)))))
    return overlaps


def _unfolded(mesh: Mesh, area: Doubles, charts: Charts) -> tuple[Charts, Bools]:
    """The charts with the inner corners of folded faces moved to the middle of their neighbors,
    and (n,) the faces that are still folded.

    Removes the folds that noise makes in a flat region, where cutting would shatter it.
    """
    every = np.arange(len(charts.faces))
    bad = _folded(mesh, area, charts, every)
    free = np.ones(len(charts.uv), bool)
    free[border_edges(charts)] = False
    for _ in range(RELAXATIONS):
        moving = np.zeros(len(charts.uv), bool)
        moving[charts.faces[bad]] = True
        moving &= free
        if not moving.any():
            break
        touched = np.flatnonzero(moving[charts.faces].any(axis=1))
        charts = charts.with_uv(_averaged(charts.uv, charts.faces[touched], moving))
        bad[touched] = _folded(mesh, area, charts, touched)
    return charts, bad


def _averaged(old: Doubles, faces: Rows, moving: Bools) -> Doubles:
    """The uv with the moving rows at the mean of their neighbors; faces: all that touch them."""
    others = old[faces].sum(axis=1, keepdims=True) - old[faces]
    rows, where = np.unique(faces, return_inverse=True)
    sums = sum_by_label(others.reshape(-1, 2), where.ravel(), len(rows))
    counts = 2 * np.bincount(where.ravel(), minlength=len(rows))
    uv = old.copy()
    kept = moving[rows]
    uv[rows[kept]] = (sums / counts[:, None])[kept]
    return uv


def _folded(mesh: Mesh, area: Doubles, charts: Charts, rows: Rows) -> Bools:
    """(k,) of the faces in rows, those turned over, or stretched like a face at the steepest
    angle allowed. area: (F,) of the mesh's faces.
    """
    limit = np.cos(np.radians(STEEPEST_DEG))

    def of_block(part: slice) -> Bools:
        some = rows[part]
        face, flat = charts.face_of_mesh[some], charts.uv[charts.faces[some]]
        ratio = stretch(mesh.vertices[mesh.faces[face]], flat)
        return (signed_area(flat) < limit * area[face]) | (ratio * limit > 1)

    return by_blocks(len(rows), of_block)


def _row_height(charts: Charts, area: Doubles, density: Doubles) -> Doubles:
    """(count,) half a texel of each chart, mesh units."""
    faces = charts.face_of_mesh
    total = np.bincount(charts.chart_of_face, area[faces], charts.count)
    texels = np.bincount(charts.chart_of_face, (area * density)[faces], charts.count)
    return 0.5 * total / np.maximum(texels, 1e-300)


def _cut_off(mesh: Mesh, faces: Rows, labels: Rows, bad: Bools, graph: DualGraph) -> Rows:
    """(n,) connected labels in which the bad faces are regions of their own."""
    rows = np.flatnonzero(bad)
    inner = graph.restricted(rows)
    normals = 0.5 * face_cross(mesh.vertices, mesh.faces[faces[rows]])
    labels = labels.copy()
    grown = grow_regions(normals, norms(normals), inner.pairs, inner.lengths, FLATNESS)
    labels[rows] = labels.max() + 1 + grown
    return connected(labels, graph)


def _halved(mesh: Mesh, charts: Charts, layered: Bools) -> Rows:
    """(n,) labels in which each layered chart is cut at half its height above its plane."""
    if not layered.any():
        return charts.chart_of_face
    normals = face_cross(mesh.vertices, mesh.faces[charts.face_of_mesh])
    axes = plane_axes(sum_by_label(normals, charts.chart_of_face, charts.count))[:, 2]

    def heights(rows: slice) -> Doubles:
        middle = mesh.vertices[mesh.faces[charts.face_of_mesh[rows]]].mean(axis=1)
        out: Doubles = np.einsum("ij,ij->i", middle, axes[charts.chart_of_face[rows]])
        return out

    height = by_blocks(len(charts.faces), heights)
    low = np.full(charts.count, np.inf)
    high = np.full(charts.count, -np.inf)
    np.minimum.at(low, charts.chart_of_face, height)
    np.maximum.at(high, charts.chart_of_face, height)
    upper = (height > 0.5 * (low + high)[charts.chart_of_face]) & layered[charts.chart_of_face]
    return charts.chart_of_face + charts.count * upper
