"""Seams between patches: how far each photo reaches over them, and what offsets its colors.

After the seam levelling of Lempitsky and Ivanov, "Seamless mosaicing of image-based texture maps",
CVPR 2007, and Waechter, Moehrle, Goesele, "Let there be color!", ECCV 2014: an offset for each
vertex and photo. Ours: the offsets lead to what all photos agree on over longer distances, not
only to equality at the seams; and in a strip at the seams the photos fade into each other, all of
it on one side where only one of them may show the other side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from texproj.arrays import Bools, Floats, Ints
from texproj.color.patches.labels import Labels
from texproj.color.patches.views import FaceViews
from texproj.mesh import Mesh, face_areas
from texproj.options import PatchOptions

RESIDUAL = 1e-2
"""Part of the right-hand side that may be left: far below what an eye sees."""

STEPS = 200
"""Most steps of conjugate gradients; a level distance of 20 pixels takes about 15."""

OWN = 1e-3
"""Least weight of a face's own photo on it, so that no face is left without."""

FADING = 0.1
"""Weight of each photo against the one before, where a face is put together from several."""

COTANGENT = 0.29
"""Half the cotangent of 60 degrees: the smoothness of a map along one edge of a regular face."""


@dataclass(frozen=True, eq=False)
class PatchBlend:
    """What one photo gives to the surface.

    photo: its number; faces: (n,) those that it colors at least in part; corners: (n, 3, 4)
    float32 its part of the color at their corners, and what is added there to the square root of
    its linear light after the gain; linear in between.
    """

    photo: int
    faces: Ints
    corners: Floats


@dataclass(frozen=True, eq=False)
class _Share:
    """A photo's weight at vertices near its patches; 0 where it is not listed.

    reach: 1 on its patches, falling to 0 at the strip's width outside of them; weight: the same,
    falling to 0 towards faces that it must not color.
    """

    rows: Ints
    reach: Floats
    weight: Floats


class PatchBlends:
    """What each photo gives, in ascending order of their numbers; made one by one."""

    def __init__(self, mesh: Mesh, labels: Labels, views: FaceViews, options: PatchOptions) -> None:
        self._mesh, self._labels, self._views = mesh, labels, views
        self._level_px = options.level_px
        used = np.union1d(labels[labels >= 0], views.partly[views.partly >= 0])
        self.photos = [int(photo) for photo in used]
        near = _NearSeams(mesh, labels, views, options.strip_px)
        self._shares = {photo: near.share(photo) for photo in self.photos}
        self._total = np.zeros(len(mesh.vertices), np.float32)
        for share in self._shares.values():
            self._total[share.rows] += share.weight

    def __len__(self) -> int:
        return len(self.photos)

    def blend(self, number: int) -> PatchBlend:
        """What the photo `self.photos[number]` gives."""
        photo, mesh, views = self.photos[number], self._mesh, self._views
        weight = self._weight(photo)
        own, at = self._labels == photo, weight[mesh.faces]
        faces = views.seen & ~(views.outlier == photo).any(axis=1) & (at > 0).any(axis=1)
        faces &= own | (at > OWN).any(axis=1)
        rank = np.where(views.partly == photo, np.arange(views.partly.shape[1]), np.inf)
        rest = (FADING ** (1 + rank.min(axis=1))).astype(np.float32)
        chosen = np.flatnonzero(faces | (rest > 0))
        corners = np.empty((len(chosen), 3, 4), np.float32)
        corners[..., 0] = at[chosen] + rest[chosen, None]
        corners[..., 1:] = self._offsets(photo, chosen)
        return PatchBlend(photo, chosen, corners)

    def _weight(self, photo: int) -> Floats:
        """(V,) the photo's part of the color."""
        share, weight = self._shares[photo], np.zeros(len(self._mesh.vertices), np.float32)
        total = self._total[share.rows]
        part = share.weight / np.maximum(total, np.float32(1e-6))
        weight[share.rows] = np.where(total > 0, part, share.reach)
        corner = self._mesh.faces[self._labels == photo].ravel()
        weight[corner] = np.maximum(weight[corner], np.float32(OWN))
        return weight

    def _offsets(self, photo: int, chosen: Ints) -> Floats:
        """(n, 3, 3) offsets at the corners of faces: those that minimize, over the surface in
        pixels, the squared distance to the way to the consensus plus `level_px` squared times the
        squared gradient.
        """
        views = self._views
        if self._level_px <= 0 or len(chosen) == 0:
            return np.zeros((len(chosen), 3, 3), np.float32)
        vertices, corners = np.unique(self._mesh.faces[chosen], return_inverse=True)
        corners = corners.reshape(-1, 3)
        column = views.photo[chosen] == photo
        way = np.where(column[..., None], views.to_consensus[chosen], 0).sum(
            axis=1, dtype=np.float32
        )
        area_px = face_areas(self._mesh)[chosen] * views.density[chosen].astype(np.float64) ** 2
        known = area_px * column.any(axis=1)
        return _smoothed(corners, len(vertices), known, way, self._level_px)[corners]


class _NearSeams:
    """Distances on the mesh's edges from the patches, as far as the strips go."""

    def __init__(self, mesh: Mesh, labels: Labels, views: FaceViews, strip_px: float) -> None:
        self._mesh, self._labels, self._views, self._strip = mesh, labels, views, strip_px
        self._seams = _seam_vertices(mesh, labels)
        graph = _edges_px(mesh, views)
        distance = np.full(len(mesh.vertices), np.inf)
        if self._seams.any():
            source = np.flatnonzero(self._seams)
            distance = dijkstra(graph, indices=source, min_only=True, limit=strip_px)
        self._rows = np.flatnonzero(np.isfinite(distance))
        self._graph = graph[self._rows][:, self._rows]

    def share(self, photo: int) -> _Share:
        """Where the photo has weight."""
        views = self._views
        inside, barred = (np.zeros(len(self._mesh.vertices), bool) for _ in range(2))
        inside[self._mesh.faces[self._labels == photo]] = True
        barred[self._mesh.faces[views.seen & (views.outlier == photo).any(axis=1)]] = True
        reach = inside.astype(np.float32)
        near = 1 - self._away(inside & self._seams)
        reach[self._rows] = np.maximum(reach[self._rows], near)
        weight = np.where(barred, np.float32(0), reach)
        weight[self._rows] *= self._away(barred)
        rows = np.flatnonzero(reach)
        return _Share(rows, reach[rows], weight[rows])

    def _away(self, source: Bools) -> Floats:
        """Distance of the rows from vertices, 0 .. 1 = the strip's width or more."""
        start = np.flatnonzero(source[self._rows])
        if len(start) == 0:
            return np.ones(len(self._rows), np.float32)
        away = dijkstra(self._graph, indices=start, min_only=True, limit=self._strip)
        return np.minimum(away / self._strip, 1).astype(np.float32)


def _seam_vertices(mesh: Mesh, labels: Labels) -> Bools:
    """(V,) vertices whose faces have different photos."""
    low = np.full(len(mesh.vertices), np.iinfo(np.int32).max, np.int32)
    high = np.full(len(mesh.vertices), -1, np.int32)
    seen = labels >= 0
    for corner in mesh.faces[seen].T:
        np.minimum.at(low, corner, labels[seen])
        np.maximum.at(high, corner, labels[seen])
    return (high >= 0) & (low != high)


def _edges_px(mesh: Mesh, views: FaceViews) -> sparse.csr_array:
    """(V, V) lengths of the edges in pixels of the best photo, of faces that are seen."""
    faces, density = mesh.faces[views.seen], views.density[views.seen]
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    length = np.linalg.norm(mesh.vertices[start] - mesh.vertices[end], axis=1)
    length *= np.repeat(density, 3)
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((length, high, low))
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0)
    kept = order[first]
    i, j, value = low[kept], high[kept], np.maximum(length[kept], 1e-6)
    shape = (len(mesh.vertices),) * 2
    return sparse.csr_array((np.r_[value, value], (np.r_[i, j], np.r_[j, i])), shape=shape)


def _smoothed(corners: Ints, count: int, area_px: Floats, way: Floats, level_px: float) -> Floats:
    """(count, 3) values at vertices from values of faces."""
    third = np.repeat(area_px / 3, 3).astype(np.float64) + 1e-6
    mass = np.bincount(corners.ravel(), third, count)
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    links = sparse.csr_array((np.ones(len(start), np.float32), (start, end)), shape=(count, count))
    links = np.float32(COTANGENT * level_px**2) * (links + links.T)
    diagonal = (links.sum(axis=0) + mass).astype(np.float32)
    pull = [
        np.bincount(corners.ravel(), third * np.repeat(way[:, channel], 3), count)
        for channel in range(3)
    ]
    return _solved(links, diagonal, np.stack(pull, axis=1).astype(np.float32))


def _solved(links: sparse.csr_array, diagonal: Floats, right: Floats) -> Floats:
    """(n, k) solution of (diagonal - links) x = right by conjugate gradients, Jacobi
    preconditioned, all columns at once: SciPy's take one by one, six times as long.
    """
    inverse = (1 / diagonal[:, None]).astype(np.float32)
    x, rest = np.zeros_like(right), right.copy()
    step: Floats = inverse * rest
    size, enough = _dots(rest, step), RESIDUAL**2 * _dots(right, right)
    for _ in range(STEPS):
        if (_dots(rest, rest) <= enough).all():
            break
        image = diagonal[:, None] * step - links @ step
        length = size / np.maximum(_dots(step, image), np.float32(1e-30))
        x += length * step
        rest -= length * image
        guess: Floats = inverse * rest
        size, before = _dots(rest, guess), size
        step = guess + (size / np.maximum(before, np.float32(1e-30))).astype(np.float32) * step
    return x


def _dots(a: Floats, b: Floats) -> Floats:
    return np.einsum("nk,nk->k", a, b)
