"""Colors for texels that no photo sees, from the surface around them rather than from what happens
to lie beside them on the page.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.color.filling.vertices import fill_vertices
from texproj.color.points.texels import TexelPoints
from texproj.mesh import Mesh
from texproj.resources.threads import in_parallel
from texproj.unwrap.atlas import Atlas

Pages = list[NDArray[Any]]

INWARDS = 0.3
"""How far from a corner towards the middle of its face its color is read: on the chart for sure."""

FADE = 6
"""Texels over which what is seen fades into what is filled: beside surface that is hidden in all
photos the last of them show a bit of what hides it."""

WIDE = 3
"""Texels across unseen surface from which on it is faded into: narrower gaps are closed alone."""

STRIP = 512
"""Rows of a page that are looked at at once."""


def fill_unseen(
    mesh: Mesh, atlas: Atlas, points: TexelPoints, pages: Pages, counts: list[NDArray[np.uint8]]
) -> None:
    """Color, in place, the texels of charts whose count of photos is 0, and fade those beside them
    into the same.
    """
    if sum(int(np.count_nonzero(count)) for count in counts) == sum(points.sizes):
        return
    apart = [
        from_unseen(count, points.inside(number, count.shape))
        for number, count in enumerate(counts)
    ]
    rgb, seen = vertex_colors(mesh, atlas, pages, apart)
    if not seen.any():
        return
    rgb = fill_vertices(mesh, rgb, seen)
    corners = atlas.uv_px[atlas.faces]

    def one(number: int) -> None:
        tile = points.tiles[number]
        distance = apart[tile.page][tile.rows, tile.columns]
        touched = points.mask(number) & (distance <= FADE)
        if touched.any():
            face = points.owners_at(number, touched)
            row, column = np.nonzero(touched)
            xy = np.stack([column + (tile.columns.start + 0.5), row + (tile.rows.start + 0.5)], 1)
            weight = barycentric(corners[face], xy)
            colors = np.einsum("nk,nkc->nc", weight, rgb[mesh.faces[face]])
            page = pages[tile.page][tile.rows, tile.columns]
            kept = (distance[touched][:, None] / (FADE + 1)) ** 2
            colors += kept * (page[touched] - colors)
            page[touched] = np.round(colors.clip(0, np.iinfo(page.dtype).max)).astype(page.dtype)

    in_parallel(one, range(len(points.tiles)))


def from_unseen(count: NDArray[np.uint8], inside: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(h, w) 0 where a page's chart is not seen, 1 to `FADE` within so many texels of such parts
    that are `WIDE`, `FADE` + 1 elsewhere.

    count: (h, w) photos that see a texel; inside: (h, w) whether it is on the surface.
    """
    out = np.full(count.shape, FADE + 1, np.uint8)
    margin, kernel = FADE + WIDE, np.ones((WIDE, WIDE), np.uint8)

    def one(number: int) -> None:
        first, last = number * STRIP, min((number + 1) * STRIP, len(count))
        rows = slice(max(first - margin, 0), last + margin)
        unseen = (inside[rows] & (count[rows] == 0)).view(np.uint8)
        if not unseen.any():
            return
        own = slice(first - rows.start, last - rows.start)
        wide = cv2.morphologyEx(unseen, cv2.MORPH_OPEN, kernel)
        far = cv2.distanceTransform(1 - wide, cv2.DIST_L2, 3)[own]
        np.minimum(out[first:last], np.ceil(far), out=out[first:last], casting="unsafe")
        out[first:last][unseen[own] > 0] = 0

    in_parallel(one, range(-(-len(count) // STRIP)))
    return out


def vertex_colors(
    mesh: Mesh, atlas: Atlas, pages: Pages, apart: list[NDArray[np.uint8]]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(V, 3) encoded colors of the vertices as the texels at the faces' corners have them that are
    seen and not near what is unseen, and (V,) whether there are any. apart: see `from_unseen`.
    """
    total = np.zeros((len(mesh.vertices), 4))
    for page, (image, distance) in enumerate(zip(pages, apart, strict=True)):
        faces = np.flatnonzero(atlas.page_of_face == page)
        corners = atlas.uv_px[atlas.faces[faces]]
        xy = corners + INWARDS * (corners.mean(axis=1, keepdims=True) - corners)
        at = np.minimum(np.floor(xy.reshape(-1, 2)), np.array(image.shape[1::-1]) - 1)
        column, row = at.astype(np.int64).T
        sure = np.flatnonzero(distance[row, column] > FADE)
        vertex = mesh.faces[faces].ravel()[sure]
        values = image[row[sure], column[sure]]
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
