"""Charts: connected regions of a surface laid flat, one plane for each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Doubles, Ints
from texproj.mesh import Mesh, face_cross
from texproj.unwrap.regions import DualGraph, connected, sum_by_label

TURNS = 18  # directions tried for the smallest bounding box, over a quarter turn


@dataclass(frozen=True, eq=False)
class Charts:
    """Charts laid flat, in mesh units or texels.

    uv: (W, 2) float64; faces: (n, 3) int64 rows of uv; vertex_of_uv, chart_of_uv: (W,) int64,
    chart_of_uv ascending; chart_of_face: (n,) int64; face_of_mesh: (n,) int64, which face of the
    mesh each is; count: number of charts.
    """

    uv: Doubles
    faces: Ints
    vertex_of_uv: Ints
    chart_of_uv: Ints
    chart_of_face: Ints
    face_of_mesh: Ints
    count: int

    @property
    def starts(self) -> Ints:
        """(count,) first row of uv of each chart."""
        return np.searchsorted(self.chart_of_uv, np.arange(self.count))

    def with_uv(self, uv: Doubles) -> Charts:
        """The same charts at other places."""
        return replace(self, uv=uv)


def project(mesh: Mesh, face_of_mesh: Ints, labels: Ints) -> Charts:
    """The given faces, projected region by region along the mean normal of the region.

    labels: (n,) int64, 0..count-1, each in use.
    """
    count = int(labels.max()) + 1
    corners = mesh.faces[face_of_mesh].astype(np.int64)
    chart, vertex, faces = _own_rows(labels, corners, len(mesh.vertices))
    normals = face_cross(mesh.vertices, mesh.faces[face_of_mesh])
    axes = plane_axes(sum_by_label(normals, labels, count))
    origin = np.searchsorted(chart, np.arange(count))
    xyz = mesh.vertices[vertex] - mesh.vertices[vertex[origin]][chart]
    uv = np.einsum("ijk,ik->ij", axes[chart, :2], xyz)
    return Charts(uv, faces, vertex, chart, labels, face_of_mesh, count)


def select(charts: Charts, rows: Ints, graph: DualGraph, labels: Ints | None = None) -> Charts:
    """The charts of some faces only, at the same places; parts without a common edge become
    charts of their own. graph: of the faces of `charts`; labels: (n,) int64 other charts for
    them.
    """
    labels = charts.chart_of_face if labels is None else labels
    labels = connected(labels[rows], graph.restricted(rows))
    chart, old, faces = _own_rows(labels, charts.faces[rows], len(charts.uv))
    return Charts(
        uv=charts.uv[old],
        faces=faces,
        vertex_of_uv=charts.vertex_of_uv[old],
        chart_of_uv=chart,
        chart_of_face=labels,
        face_of_mesh=charts.face_of_mesh[rows],
        count=int(labels.max(initial=-1)) + 1,
    )


def join(parts: list[Charts]) -> Charts:
    """All charts in one, faces in the order of the mesh; the parts hold each face once."""
    first_row = np.cumsum([0] + [len(p.uv) for p in parts])
    first_chart = np.cumsum([0] + [p.count for p in parts])
    order = np.argsort(np.concatenate([p.face_of_mesh for p in parts]))
    faces = np.concatenate([p.faces + n for p, n in zip(parts, first_row, strict=False)])
    of_uv = [p.chart_of_uv + n for p, n in zip(parts, first_chart, strict=False)]
    of_face = [p.chart_of_face + n for p, n in zip(parts, first_chart, strict=False)]
    return Charts(
        uv=np.concatenate([p.uv for p in parts]),
        faces=faces[order],
        vertex_of_uv=np.concatenate([p.vertex_of_uv for p in parts]),
        chart_of_uv=np.concatenate(of_uv),
        chart_of_face=np.concatenate(of_face)[order],
        face_of_mesh=np.arange(len(order)),
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


def border_edges(charts: Charts) -> Ints:
    """(B, 2) rows of uv: the edges without exactly one face on each side, in the direction of
    each of their faces.
    """
    start = charts.faces.ravel()
    end = np.roll(charts.faces, -1, axis=1).ravel()
    key = np.minimum(start, end) * len(charts.uv) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    twice = first[np.diff(first, append=len(order)) == 2]
    one, two = order[twice], order[twice + 1]
    inner = start[one] == end[two]
    border = np.ones(len(start), bool)
    border[one[inner]] = border[two[inner]] = False
    return np.stack([start[border], end[border]], axis=1)


def extents(uv: Doubles, starts: Ints) -> tuple[Doubles, Doubles]:
    """(n, 2) lower corner and (n, 2) size of each run of rows of uv (W, 2)."""
    low = np.minimum.reduceat(uv, starts)
    return low, np.maximum.reduceat(uv, starts) - low


def plane_axes(normals: Doubles) -> Doubles:
    """(n, 3, 3) right-handed axes x, y, z (rows) with z along each of (n, 3) normals."""
    z = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    x = np.cross(np.eye(3)[np.abs(z).argmin(axis=1)], z)
    x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _own_rows(labels: Ints, corners: Ints, count: int) -> tuple[Ints, Ints, Ints]:
    """One row for each corner (< count) of each chart: its chart, its corner, faces into rows."""
    key = np.repeat(labels, 3) * count + corners.ravel()
    unique, rows = np.unique(key, return_inverse=True)
    return unique // count, unique % count, rows.reshape(-1, 3)


def _turn(uv: Doubles, angle_rad: Doubles) -> Doubles:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.stack([c * uv[:, 0] - s * uv[:, 1], s * uv[:, 0] + c * uv[:, 1]], axis=1)
