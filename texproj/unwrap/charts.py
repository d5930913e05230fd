"""Charts: connected regions of a surface laid flat, one plane for each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Doubles, Rows
from texproj.mesh import Mesh, face_cross
from texproj.unwrap.halfedges import half_edges, opposite, ordered
from texproj.unwrap.regions import DualGraph, connected, sum_by_label

TURNS = 18  # directions tried for the smallest bounding box, over a quarter turn


@dataclass(frozen=True, eq=False)
class Charts:
    """Charts laid flat, in mesh units or texels.

    uv: (W, 2) float64; faces: (n, 3) rows of uv; vertex_of_uv, chart_of_uv: (W,), chart_of_uv
    ascending; chart_of_face: (n,); face_of_mesh: (n,), which face of the mesh each is; all int32;
    count: number of charts.
    """

    uv: Doubles
    faces: Rows
    vertex_of_uv: Rows
    chart_of_uv: Rows
    chart_of_face: Rows
    face_of_mesh: Rows
    count: int

    @property
    def starts(self) -> Rows:
        """(count,) first row of uv of each chart."""
        return np.searchsorted(self.chart_of_uv, np.arange(self.count))

    def with_uv(self, uv: Doubles) -> Charts:
        """The same charts at other places."""
        return replace(self, uv=uv)


def project(mesh: Mesh, face_of_mesh: Rows, labels: Rows) -> Charts:
    """The given faces, projected region by region along the mean normal of the region.

    labels: (n,) 0..count-1, each in use.
    """
    count, corners = int(labels.max()) + 1, mesh.faces[face_of_mesh]
    chart, vertex, faces = own_rows(labels, corners, (count, len(mesh.vertices)))
    normals = face_cross(mesh.vertices, corners)
    axes = plane_axes(sum_by_label(normals, labels, count))
    origin = np.searchsorted(chart, np.arange(count))
    xyz = mesh.vertices[vertex] - mesh.vertices[vertex[origin]][chart]
    uv = np.einsum("ijk,ik->ij", axes[chart, :2], xyz)
    return Charts(uv, faces, vertex, chart, labels.astype(np.int32), face_of_mesh, count)


def select(charts: Charts, rows: Rows, graph: DualGraph, labels: Rows | None = None) -> Charts:
    """The charts of some faces only, at the same places; parts without a common edge become
    charts of their own. graph: of these faces; labels: (n,) other charts for all faces of
    `charts`.
    """
    labels = charts.chart_of_face if labels is None else labels
    parts = connected(labels[rows], graph)
    count = int(parts.max(initial=-1)) + 1
    chart, old, faces = own_rows(parts, charts.faces[rows], (count, len(charts.uv)))
    return Charts(
        uv=charts.uv[old],
        faces=faces,
        vertex_of_uv=charts.vertex_of_uv[old],
        chart_of_uv=chart,
        chart_of_face=parts.astype(np.int32),
        face_of_mesh=charts.face_of_mesh[rows],
        count=count,
    )


def join(parts: list[Charts]) -> Charts:
    """All charts in one, faces in the order of the mesh; the parts hold each face once."""
    first_row = np.cumsum([0] + [len(p.uv) for p in parts])
    first_chart = np.cumsum([0] + [p.count for p in parts])
    count = sum(len(p.faces) for p in parts)
    faces, chart_of_face = np.empty((count, 3), np.int32), np.empty(count, np.int32)
    for part, row, chart in zip(parts, first_row, first_chart, strict=False):
        faces[part.face_of_mesh] = part.faces + row
        chart_of_face[part.face_of_mesh] = part.chart_of_face + chart
    of_uv = [p.chart_of_uv + n for p, n in zip(parts, first_chart, strict=False)]
    return Charts(
        uv=np.concatenate([p.uv for p in parts]),
        faces=faces,
        vertex_of_uv=np.concatenate([p.vertex_of_uv for p in parts]),
        chart_of_uv=np.concatenate(of_uv).astype(np.int32),
        chart_of_face=chart_of_face,
        face_of_mesh=np.arange(count, dtype=np.int32),
        count=int(first_chart[-1]),
    )


def upright(charts: Charts) -> Charts:
    """The charts turned to their smallest bounding boxes, lower left corners at the origin."""
    angles = np.arange(TURNS) * (np.pi / 2 / TURNS)
    border = np.unique(border_edges(charts))
    starts = np.searchsorted(charts.chart_of_uv[border], np.arange(charts.count))
    sizes = [extents(_turn(charts.uv[border], a), starts)[1].prod(axis=1) for a in angles]
    best = angles[np.argmin(sizes, axis=0)]
    uv = _turn(charts.uv, best[charts.chart_of_uv])
    low, _ = extents(uv, charts.starts)
    return charts.with_uv(uv - low[charts.chart_of_uv])


def border_edges(charts: Charts) -> Rows:
    """(B, 2) rows of uv: the edges without exactly one face on each side, in the direction of
    each of their faces.
    """
    start, end = half_edges(charts.faces)
    border = np.ones(len(start), bool)
    for inner in opposite(start, end, len(charts.uv)):
        border[inner] = False
    return np.stack([start[border], end[border]], axis=1)


def extents(uv: Doubles, starts: Rows) -> tuple[Doubles, Doubles]:
    """(n, 2) lower corner and (n, 2) size of each run of rows of uv (W, 2)."""
    low = np.minimum.reduceat(uv, starts)
    return low, np.maximum.reduceat(uv, starts) - low


def plane_axes(normals: Doubles) -> Doubles:
    """(n, 3, 3) right-handed axes x, y, z (rows) with z along each of (n, 3) normals."""
    z = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    x = np.cross(np.eye(3)[np.abs(z).argmin(axis=1)], z)
    x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
    return np.stack([x, np.cross(z, x), z], axis=1)


def own_rows(labels: Rows, corners: Rows, counts: tuple[int, int]) -> tuple[Rows, Rows, Rows]:
    """One row for each corner of each chart: its chart, its corner, faces into rows.

    labels: (n,) chart of each face; corners: (n, 3); counts: of charts and of possible corners.
    """
    chart, corner = np.repeat(labels.astype(np.int32), 3), corners.ravel()
    order, new = ordered(chart, corner, *counts)
    rows = np.empty(len(order), np.int32)
    rows[order] = np.cumsum(new, dtype=np.int32) - 1
    first = order[new]
    return chart[first], corner[first].astype(np.int32), rows.reshape(-1, 3)


def _turn(uv: Doubles, angle_rad: Doubles) -> Doubles:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.stack([c * uv[:, 0] - s * uv[:, 1], s * uv[:, 0] + c * uv[:, 1]], axis=1)
