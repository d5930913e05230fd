"""Seams between patches: how far each photo reaches over them, and what offsets its colors.

After the seam levelling of Lempitsky and Ivanov, "Seamless mosaicing of image-based texture maps",
CVPR 2007, and Waechter, Moehrle, Goesele, "Let there be color!", ECCV 2014: an offset for each
vertex and photo. Ours: the offsets lead to what all photos agree on over longer distances, not
only to equality at the seams; and in a strip at the seams the photos fade into each other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import cg

from texproj.color.patch_labels import Labels
from texproj.color.patch_views import FaceViews
from texproj.color.points import Floats
from texproj.mesh import Mesh, face_areas

RESIDUAL = 1e-2
"""Part of the right-hand side that may be left: far below what an eye sees."""

OWN = 1e-3
"""Least weight of a face's own photo on it, so that no face is left without."""

FADING = 0.1
"""Weight of each photo against the one before, where a face is put together from several."""

COTANGENT = 0.29
"""Half the cotangent of 60 degrees: the smoothness of a map along one edge of a regular face."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PatchBlend:
    """What one photo gives to the surface.

    photo: its number; faces: (F,) bool, those that it colors at least in part; weight: (V,)
    float32 its part of the color at each vertex, linear in between; offset: (V, 3) float32 what is
    added to the square root of its linear light after the gain, linear in between; glimpsed: (F,)
    float32 its weight on faces that no photo shows as a whole, without an offset, 0 on others.
    """

    photo: int
    faces: Bools
    weight: Floats
    offset: Floats
    glimpsed: Floats

    def at_corners(self, faces: NDArray[np.int32]) -> Floats:
        """(F, 3, 4) weight and offset at the corners of the mesh's faces."""
        out = np.column_stack([self.weight, self.offset])[faces]
        rows = np.flatnonzero(self.glimpsed)
        out[rows] = 0
        out[rows, :, 0] = self.glimpsed[rows, None]
        return out


def patch_blends(
    mesh: Mesh, labels: Labels, views: FaceViews, strip_px: float, level_px: float
) -> list[PatchBlend]:
    """What each photo gives, in ascending order of their numbers.

    strip_px: width on either side of a seam in which the photos fade; level_px: distance over
    which the colors are brought to what all photos agree on. Pixels of the best photo.
    """
    parts = list(_shares(mesh, labels, views, strip_px))
    offsets = _offsets(mesh, views, parts, level_px)
    blends = []
    for (photo, faces, weight), offset in zip(parts, offsets, strict=True):
        rank = np.where(views.glimpse == photo, np.arange(views.glimpse.shape[1]), np.inf)
        glimpsed = (FADING ** rank.min(axis=1)).astype(np.float32)
        blends.append(PatchBlend(photo, faces | (glimpsed > 0), weight, offset, glimpsed))
    return blends


def _shares(
    mesh: Mesh, labels: Labels, views: FaceViews, strip_px: float
) -> Iterator[tuple[int, Bools, Floats]]:
    """Photo, faces, and vertex weights for each photo in use."""
    used = np.union1d(labels[labels >= 0], views.glimpse[views.glimpse >= 0])
    photos = [int(p) for p in used]
    near = _NearSeams(mesh, labels, views, strip_px)
    total = np.zeros(len(mesh.vertices), np.float32)
    columns = []
    for photo in photos:
        allowed = views.seen & ~(views.outlier == photo).any(axis=1)
        reach = near.reach(photo)
        everywhere = np.ones(len(mesh.vertices), bool)
        everywhere[mesh.faces[~allowed & views.seen]] = False
        weight = np.where(everywhere, reach, 0)
        total += weight
        columns.append((photo, allowed, reach, weight))
    for photo, allowed, reach, gated in columns:
        weight = np.where(total > 0, gated / np.maximum(total, np.float32(1e-6)), reach)
        own = labels == photo
        corner = mesh.faces[own].ravel()
        weight[corner] = np.maximum(weight[corner], np.float32(OWN))
        faces = allowed & (weight[mesh.faces] > 0).any(axis=1)
        faces &= own | (weight[mesh.faces] > OWN).any(axis=1)
        yield photo, faces, weight


class _NearSeams:
    """Distances on the mesh's edges from the patches, as far as the strips go."""

    def __init__(self, mesh: Mesh, labels: Labels, views: FaceViews, strip_px: float) -> None:
        self._mesh, self._labels, self._strip = mesh, labels, strip_px
        seams = _seam_vertices(mesh, labels)
        self._own = seams
        graph = _edges_px(mesh, views)
        distance = np.full(len(mesh.vertices), np.inf)
        if seams.any():
            source = np.flatnonzero(seams)
            distance = dijkstra(graph, indices=source, min_only=True, limit=strip_px)
        self._rows = np.flatnonzero(np.isfinite(distance))
        self._graph = graph[self._rows][:, self._rows]

    def reach(self, photo: int) -> Floats:
        """(V,) 1 on the photo's patches, falling to 0 at the strip's width outside of them."""
        inside = np.zeros(len(self._mesh.vertices), bool)
        inside[self._mesh.faces[self._labels == photo]] = True
        out = inside.astype(np.float32)
        source = np.flatnonzero((inside & self._own)[self._rows])
        if len(source):
            away = dijkstra(self._graph, indices=source, min_only=True, limit=self._strip)
            near = np.maximum(1 - away / self._strip, 0)
            out[self._rows] = np.maximum(out[self._rows], near)
        return out


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


def _offsets(
    mesh: Mesh, views: FaceViews, parts: list[tuple[int, Bools, Floats]], level_px: float
) -> Iterator[Floats]:
    """(V, 3) offsets of each photo: those that minimize, over the surface in pixels, the squared
    distance to the way to the consensus plus `level_px` squared times the squared gradient.
    """
    area_px = (face_areas(mesh) * views.density.astype(np.float64) ** 2).astype(np.float32)
    for photo, faces, _ in parts:
        chosen = np.flatnonzero(faces)
        vertices, corners = np.unique(mesh.faces[chosen], return_inverse=True)
        corners = corners.reshape(-1, 3)
        column = views.photo[chosen] == photo
        way = (views.to_consensus[chosen] * column[..., None]).sum(axis=1)
        known = area_px[chosen] * column.any(axis=1)
        out = np.zeros((len(mesh.vertices), 3), np.float32)
        if level_px > 0 and len(chosen):
            out[vertices] = _smoothed(corners, len(vertices), known, way, level_px)
        yield out


def _smoothed(
    corners: NDArray[np.int64], count: int, area_px: Floats, way: Floats, level_px: float
) -> Floats:
    """(count, 3) values at vertices from values of faces."""
    third = np.repeat(area_px / 3, 3).astype(np.float64) + 1e-6
    mass = np.bincount(corners.ravel(), third, count)
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    links = sparse.csr_array((np.ones(len(start)), (start, end)), shape=(count, count))
    links = (COTANGENT * level_px**2) * (links + links.T)
    diagonal = links.sum(axis=0) + mass
    system = sparse.csr_array(sparse.diags_array(diagonal) - links)
    inverse = sparse.diags_array(1 / diagonal)
    out = np.zeros((count, 3), np.float32)
    for channel in range(3):
        pull = np.bincount(corners.ravel(), third * np.repeat(way[:, channel], 3), count)
        out[:, channel] = cg(system, pull, pull / mass, rtol=RESIDUAL, maxiter=200, M=inverse)[0]
    return out
