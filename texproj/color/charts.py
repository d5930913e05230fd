"""Lay regions of a surface out flat: one plane for each chart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.color.segmentation import (
    DualGraph,
    Floats,
    Ints,
    connected,
    grow_regions,
    smoothed_normals,
    sum_by_label,
)
from texproj.mesh import Mesh, face_cross
from texproj.options import UnwrapOptions

TURNS = 18  # directions tried for the smallest bounding box, over a quarter turn


@dataclass(frozen=True, eq=False)
class Charts:
    """Charts laid flat, each about its own origin, in mesh units.

    uv: (W, 2) float64; faces: (F, 3) int64 rows of uv; vertex_of_uv, chart_of_uv: (W,) int64,
    chart_of_uv ascending; chart_of_face: (F,) int64; count: number of charts.
    """

    uv: Floats
    faces: Ints
    vertex_of_uv: Ints
    chart_of_uv: Ints
    chart_of_face: Ints
    count: int

    @property
    def starts(self) -> Ints:
        """(count,) first row of uv of each chart."""
        return np.searchsorted(self.chart_of_uv, np.arange(self.count))


def flat_regions(mesh: Mesh, graph: DualGraph, options: UnwrapOptions) -> Ints:
    """(F,) int64 labels of connected regions, each projected by its mean normal without a face
    steeper than options.steepest_deg or turned over.

    Faces that are too steep for their region are cut off and form regions among themselves.
    """
    normals = 0.5 * face_cross(mesh.vertices, mesh.faces)
    smooth = smoothed_normals(normals, graph)
    labels = grow_regions(smooth, graph.pairs, graph.lengths, options.flatness)
    for _ in range(12):
        steep = _too_steep(normals, labels, options.steepest_deg)
        if not steep.any():
            return connected(labels, graph)
        labels = _cut_off(labels, steep, normals, graph, options.flatness)
    steep = _too_steep(normals, labels, options.steepest_deg)
    labels[steep] = labels.max() + 1 + np.arange(np.count_nonzero(steep))
    return connected(labels, graph)


def lay_flat(mesh: Mesh, chart_of_face: Ints) -> Charts:
    """Every chart projected along its mean normal, turned to its smallest bounding box."""
    count = int(chart_of_face.max()) + 1
    vertices = len(mesh.vertices)
    key = np.repeat(chart_of_face, 3) * vertices + mesh.faces.ravel()
    unique, corner = np.unique(key, return_inverse=True)
    chart, vertex = unique // vertices, unique % vertices
    axes = _plane_axes(sum_by_label(face_cross(mesh.vertices, mesh.faces), chart_of_face, count))
    xyz = mesh.vertices[vertex] - mesh.center
    uv = np.einsum("ijk,ik->ij", axes[chart], xyz)
    charts = Charts(uv, corner.reshape(-1, 3), vertex, chart, chart_of_face, count)
    return _turned(charts)


def _too_steep(normals: Floats, labels: Ints, steepest_deg: float) -> NDArray[np.bool_]:
    total = sum_by_label(normals, labels, int(labels.max()) + 1)
    axis = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    along = np.einsum("ij,ij->i", normals, axis[labels])
    return along < np.cos(np.radians(steepest_deg)) * np.linalg.norm(normals, axis=1)


def _cut_off(
    labels: Ints, steep: NDArray[np.bool_], normals: Floats, graph: DualGraph, flatness: float
) -> Ints:
    rows = np.flatnonzero(steep)
    row_of_face = np.cumsum(steep) - 1
    both = steep[graph.pairs].all(axis=1)
    pairs = row_of_face[graph.pairs[both]]
    labels = labels.copy()
    grown = grow_regions(normals[rows], pairs, graph.lengths[both], flatness)
    labels[rows] = labels.max() + 1 + grown
    return np.unique(labels, return_inverse=True)[1]


def _plane_axes(normals: Floats) -> Floats:
    """(n, 2, 3) right-handed axes of the planes across (n, 3) normals: x cross y = normal."""
    axis = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    helper = np.eye(3)[np.abs(axis).argmin(axis=1)]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(axis, x)], axis=1)


def _turned(charts: Charts) -> Charts:
    """The charts turned to their smallest bounding boxes, lower left corners at the origin."""
    angles = np.arange(TURNS) * (np.pi / 2 / TURNS)
    size = np.stack(
        [np.prod(extents(_turn(charts, angle), charts.starts)[1], 1) for angle in angles]
    )
    best = angles[size.argmin(axis=0)][charts.chart_of_uv]
    uv = _turn(charts, best)
    low, _ = extents(uv, charts.starts)
    uv = uv - low[charts.chart_of_uv]
    return Charts(
        uv,
        charts.faces,
        charts.vertex_of_uv,
        charts.chart_of_uv,
        charts.chart_of_face,
        charts.count,
    )


def _turn(charts: Charts, angle: float | Floats) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    x, y = charts.uv.T
    return np.stack([c * x - s * y, s * x + c * y], axis=1)


def extents(uv: Floats, starts: Ints) -> tuple[Floats, Floats]:
    """(n, 2) lower corner and (n, 2) size of each run of rows of uv (W, 2)."""
    low = np.minimum.reduceat(uv, starts)
    return low, np.maximum.reduceat(uv, starts) - low
