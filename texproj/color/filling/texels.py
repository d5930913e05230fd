"""Colors for texels that no photo sees, from the surface around them rather than from what happens
to lie beside them on the page.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.color.filling.vertices import fill_vertices
from texproj.color.points.texels import TexelPoints
from texproj.mesh import Mesh
from texproj.unwrap.atlas import Atlas

Pages = list[NDArray[Any]]

INWARDS = 0.3
"""How far from a corner towards the middle of its face its color is read: on the chart for sure."""


def fill_unseen(
    mesh: Mesh, atlas: Atlas, points: TexelPoints, pages: Pages, counts: list[NDArray[np.uint8]]
) -> None:
    """Color, in place, the texels of charts whose count of photos is 0."""
    if sum(int(np.count_nonzero(count)) for count in counts) == sum(points.sizes):
        return
    rgb, seen = vertex_colors(mesh, atlas, pages, counts)
    if not seen.any():
        return
    rgb = fill_vertices(mesh, rgb, seen)
    corners = atlas.uv_px[atlas.faces]
    for number, tile in enumerate(points.tiles):
        count = counts[tile.page][tile.rows, tile.columns]
        empty = points.mask(number) & (count == 0)
        if empty.any():
            face = points.owners_at(number, empty)
            row, column = np.nonzero(empty)
            xy = np.stack([column + (tile.columns.start + 0.5), row + (tile.rows.start + 0.5)], 1)
            weight = barycentric(corners[face], xy)
            colors = np.einsum("nk,nkc->nc", weight, rgb[mesh.faces[face]])
            page = pages[tile.page][tile.rows, tile.columns]
            top = np.iinfo(page.dtype).max
            page[empty] = np.round(colors.clip(0, top)).astype(page.dtype)


def vertex_colors(
    mesh: Mesh, atlas: Atlas, pages: Pages, counts: list[NDArray[np.uint8]]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(V, 3) encoded colors of the vertices as the seen texels at the faces' corners have them,
    and (V,) whether there are any.
    """
    total = np.zeros((len(mesh.vertices), 4))
    for page, (image, count) in enumerate(zip(pages, counts, strict=True)):
        faces = np.flatnonzero(atlas.page_of_face == page)
        corners = atlas.uv_px[atlas.faces[faces]]
        xy = corners + INWARDS * (corners.mean(axis=1, keepdims=True) - corners)
        at = np.minimum(np.floor(xy.reshape(-1, 2)), np.array(image.shape[1::-1]) - 1)
        column, row = at.astype(np.int64).T
        seen = np.flatnonzero(count[row, column])
        vertex = mesh.faces[faces].ravel()[seen]
        values = image[row[seen], column[seen]]
        for channel in range(3):
            total[:, channel] += np.bincount(vertex, values[:, channel], len(total))
        total[:, 3] += np.bincount(vertex, minlength=len(total))
    rgb = total[:, :3] / np.maximum(total[:, 3:], 1)
    return rgb.astype(np.float32), total[:, 3] > 0


def barycentric(corners: NDArray[np.float64], xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) weights of the corners (n, 3, 2) at positions (n, 2)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    u, v, w = b - a, c - a, xy - a
    det = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    det = np.where(np.abs(det) > 1e-12, det, np.inf)
    s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / det
    t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / det
    return np.stack([1 - s - t, s, t], axis=1)
