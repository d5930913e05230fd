"""Colors for texels that no photo sees, from the surface around them rather than from what happens
to lie beside them on the page.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.filling.gutters import Weighed, enlarged, filled_half
from texproj.color.filling.vertices import fill_vertices
from texproj.color.points.texels import TexelPoints
from texproj.mesh import Mesh, blocks_summed
from texproj.resources.threads import in_parallel
from texproj.unwrap.atlas import Atlas

Pages = list[NDArray[Any]]

INWARDS = 0.3
"""How far from a corner towards the middle of its face its color is read: on the chart for sure."""

FADE = 3
"""Texels over which what is seen fades into what is filled: beside surface that is hidden in all
photos the last of them show a bit of what hides it."""

WIDE = 3
"""Texels across unseen surface from which on it is faded into: narrower gaps are closed alone."""

RING = 8
"""Texels beside what is unseen whose difference from the membrane of vertices goes on into it: so
that faces larger than texels leave no step."""

BESIDE, ELSEWHERE = FADE + 1, FADE + 2

SQUARE = 512
"""Edge of the part of a page that is looked at at once; most have nothing unseen."""


def fill_unseen(
    mesh: Mesh, atlas: Atlas, points: TexelPoints, pages: Pages, counts: list[NDArray[np.uint8]]
) -> None:
    """Color, in place, the texels of charts whose count of photos is 0, and fade those beside them
    into the same: the membrane of the vertices, and what the texels around differ from it, smooth
    on the page.
    """
    if sum(int(np.count_nonzero(count)) for count in counts) == sum(points.sizes):
        return
    apart = [
        from_unseen(count, points.inside(number, count.shape))
        for number, count in enumerate(counts)
    ]
    rgb, seen = vertex_colors(mesh, atlas, pages, apart)
    if seen.any():
        membrane = _Membrane(mesh, atlas, points, fill_vertices(mesh, rgb, seen))
        for number, page in enumerate(pages):
            _fill(membrane, number, page, apart[number])


@dataclass(frozen=True, eq=False)
class _Membrane:
    """The (V, 3) colors of vertices, filled, between the vertices of each face."""

    mesh: Mesh
    atlas: Atlas
    points: TexelPoints
    rgb: Floats

    def at(self, number: int, chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(n, 3) at chosen texels (an image) of a tile."""
        face, tile = self.points.owners_at(number, chosen), self.points.tiles[number]
        row, column = np.nonzero(chosen)
        xy = np.stack([column + (tile.columns.start + 0.5), row + (tile.rows.start + 0.5)], 1)
        weight = barycentric(self.atlas.uv_px[self.atlas.faces[face]], xy)
        colors: NDArray[np.float64] = np.einsum(
            "nk,nkc->nc", weight, self.rgb[self.mesh.faces[face]]
        )
        return colors


def _fill(membrane: _Membrane, number: int, page: NDArray[Any], apart: NDArray[np.uint8]) -> None:
    points = membrane.points
    tiles = [
        k for k, tile in enumerate(points.tiles)
        if tile.page == number and (apart[tile.rows, tile.columns] <= BESIDE).any()
    ]  # fmt: skip
    if not tiles:
        return

    def difference(rows: slice) -> Weighed:
        """Of a row of tiles, beside what is unseen."""
        out = np.zeros((*apart[rows].shape, 3), np.float32)
        for k in (k for k in tiles if points.tiles[k].rows.start == rows.start):
            columns = points.tiles[k].columns
            beside = points.mask(k) & (apart[rows, columns] == BESIDE)
            out[:, columns][beside] = np.round(page[rows, columns][beside] - membrane.at(k, beside))
        return out, (apart[rows] == BESIDE).astype(np.float32)

    def color(k: int) -> None:
        place = points.tiles[k].rows, points.tiles[k].columns
        touched = points.mask(k) & (apart[place] <= FADE)
        kept = apart[place][touched][:, None] / (FADE + 1)
        colors = membrane.at(k, touched) + enlarged(half, *place)[touched]
        colors += kept * (page[place][touched] - colors)
        page[place][touched] = np.round(colors.clip(0, np.iinfo(page.dtype).max))

    half = filled_half(apart.shape, difference)
    in_parallel(color, tiles)


def from_unseen(count: NDArray[np.uint8], inside: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(h, w) 0 where a page's chart is not seen, 1 to `FADE` within so many texels of such parts
    that are `WIDE`, `BESIDE` within `RING` texels of any, `ELSEWHERE` else and outside of charts.

    count: (h, w) photos that see a texel; inside: (h, w) whether it is on the surface.
    """
    out = np.full(count.shape, ELSEWHERE, np.uint8)
    margin, kernel = RING + WIDE, np.ones((WIDE, WIDE), np.uint8)
    around = np.ones((2 * RING + 1,) * 2, np.uint8)

    def one(number: int) -> None:
        own = squares[number]
        wider = tuple(slice(max(s.start - margin, 0), s.stop + margin) for s in own)
        unseen = (inside[wider] & (count[wider] == 0)).view(np.uint8)
        if not unseen.any():
            return
        row, column = (s.start - w.start for s, w in zip(own, wider, strict=True))
        part, on_chart = out[own], inside[own]
        here = slice(row, row + part.shape[0]), slice(column, column + part.shape[1])
        part[(cv2.dilate(unseen, around)[here] > 0) & on_chart] = BESIDE
        wide = cv2.morphologyEx(unseen, cv2.MORPH_OPEN, kernel)
        if wide.any():
            far = np.ceil(cv2.distanceTransform(1 - wide, cv2.DIST_L2, 3)[here])
            near = (far <= FADE) & on_chart
            part[near] = far[near]
        part[unseen[here] > 0] = 0

    squares = [
        (slice(y, y + SQUARE), slice(x, x + SQUARE))
        for y in range(0, count.shape[0], SQUARE)
        for x in range(0, count.shape[1], SQUARE)
    ]
    in_parallel(one, range(len(squares)))
    return out


def vertex_colors(
    mesh: Mesh, atlas: Atlas, pages: Pages, apart: list[NDArray[np.uint8]]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(V, 3) encoded colors of the vertices as the texels at the faces' corners have them that are
    seen and not near what is unseen, and (V,) whether there are any. apart: see `from_unseen`.
    """
    total = np.zeros((4, len(mesh.vertices)))
    for page, (image, distance) in enumerate(zip(pages, apart, strict=True)):
        on_page = np.flatnonzero(atlas.page_of_face == page)
        for rows in blocks_summed(len(on_page), len(mesh.vertices)):
            faces = on_page[rows]
            corners = atlas.uv_px[atlas.faces[faces]]
            xy = corners + INWARDS * (corners.mean(axis=1, keepdims=True) - corners)
            at = np.minimum(np.floor(xy.reshape(-1, 2)), np.array(image.shape[1::-1]) - 1)
            column, row = at.astype(np.int64).T
            sure = np.flatnonzero(distance[row, column] > FADE)
            vertex = mesh.faces[faces].ravel()[sure]
            values = image[row[sure], column[sure]].astype(np.float64)
            for channel in range(3):
                total[channel] += np.bincount(vertex, values[:, channel], len(mesh.vertices))
            total[3] += np.bincount(vertex, minlength=len(mesh.vertices))
    rgb = total[:3] / np.maximum(total[3], 1)
    return np.ascontiguousarray(rgb.T, np.float32), total[3] > 0


def barycentric(corners: NDArray[np.float64], xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) weights of the corners (n, 3, 2) at positions (n, 2)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    u, v, w = b - a, c - a, xy - a
    det = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    det = np.where(np.abs(det) > 1e-12, det, np.inf)
    s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / det
    t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / det
    return np.stack([1 - s - t, s, t], axis=1)
