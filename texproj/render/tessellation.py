"""Faces split until the lens bends no edge visibly, so that distorting the vertices is enough."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats

MAX_ROUNDS = 12
"""Each round halves what is too long; twelve are enough for a face as large as 4000 pixels."""

MOST_NEW_FACES = 500_000
"""Splitting ends with the round that makes more: twice what a lens that exists needs for a picture
of 24 megapixels; one that does not would be followed until memory ends."""

Integers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Where a camera stands and looks.

    center (3,) and axis (3,) of a camera in scene coordinates; nearest: smallest distance that
    is told apart, so that what passes through the camera is not split for ever.
    """

    center: Floats
    axis: Floats
    nearest: float


@dataclass(frozen=True, eq=False)
class Tessellation:
    """Vertices and faces of a surface with edges split in the middle; both faces at an edge split
    it alike, so that no crack opens.

    xyz: (W, 3) float32, the surface's vertices first; faces: (G, 3) int32;
    face_of: (G,) int32 face of the surface that each is or is a part of;
    rounds: of each round of splitting the pairs (m, 2) of vertices that the new ones lie between.
    """

    xyz: Floats
    faces: Integers
    face_of: Integers
    rounds: tuple[Integers, ...] = ()

    @cached_property
    def reach(self) -> Floats:
        """(W,) length of the longest edge at each vertex."""
        corners = [self.xyz[self.faces[:, i]] for i in range(3)]
        opposite = [_squared(corners[i - 1] - corners[i - 2]) for i in range(3)]
        longest2 = np.zeros(len(self.xyz), np.float32)
        for i in range(3):
            np.maximum.at(longest2, self.faces[:, i], np.maximum(opposite[i - 1], opposite[i - 2]))
        return np.sqrt(longest2)

    def largest_span(self, view: Viewpoint) -> float:
        """A bound on the angle (rad) that any edge not behind the camera spans, seen from there."""
        from_center = self.xyz - view.center
        before = from_center @ view.axis > -self.reach
        distance = np.sqrt(_squared(from_center)) - self.reach
        span = self.reach / np.maximum(distance, view.nearest)
        return float(span.max(where=before, initial=0))

    def extended(self, values: Floats) -> Floats:
        """(W, ...) values of the surface's vertices (V, ...), interpolated at the new vertices."""
        for pairs in self.rounds:
            middle = (values[pairs[:, 0]] + values[pairs[:, 1]]) / 2
            values = np.concatenate([values, middle.astype(np.float32)])
        return values

    def refined(self, view: Viewpoint, max_span: float) -> Tessellation:
        """With every edge not behind the camera split until it spans at most `max_span` (rad)."""
        out = self
        for _ in range(MAX_ROUNDS):
            long = _long_edges(out, view, max_span)
            if not len(long.faces) or len(out.faces) > len(self.faces) + MOST_NEW_FACES:
                break
            out = _split(out, long)
        return out


@dataclass(frozen=True, eq=False)
class _LongEdges:
    """faces: (n,) numbers of the faces that are to be split; edges: (n, 3) bool, which of theirs
    from corner i to corner i + 1.
    """

    faces: NDArray[np.intp]
    edges: NDArray[np.bool_]


def _long_edges(mesh: Tessellation, view: Viewpoint, max_span: float) -> _LongEdges:
    """The edges to be split; both faces at one agree."""
    slack = np.maximum(np.sqrt(_squared(mesh.xyz - view.center)) - mesh.reach, view.nearest)
    suspects = np.flatnonzero(_of_any_corner(mesh.reach > max_span * slack, mesh.faces))
    ends = _edges(mesh.faces[suspects]).reshape(-1, 2)
    a, b = mesh.xyz[ends[:, 0]] - view.center, mesh.xyz[ends[:, 1]] - view.center
    along = b - a
    length2 = np.maximum(_squared(along), np.float32(1e-30))
    nearest = a + along * np.clip(-np.einsum("ij,ij->i", a, along) / length2, 0, 1)[:, None]
    distance = np.maximum(np.sqrt(_squared(nearest)), view.nearest)
    before = np.maximum(a @ view.axis, b @ view.axis) > 0
    long = (before & (np.sqrt(length2) > max_span * distance)).reshape(-1, 3)
    split = np.flatnonzero(long.any(axis=1))
    return _LongEdges(suspects[split], long[split])


def _of_any_corner(vertices: NDArray[np.bool_], faces: Integers) -> NDArray[np.bool_]:
    """(G,) what is true of any corner of each face."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return a | b | c


def _squared(xyz: Floats) -> Floats:
    """(n,) squared lengths, several times as fast as by the root that numpy takes."""
    out: Floats = np.einsum("ij,ij->i", xyz, xyz)
    return out


def _edges(faces: Integers) -> Integers:
    """(n, 3, 2) ends of the edges of faces (n, 3), the smaller number first."""
    after = np.roll(faces, -1, axis=1)
    return np.stack([np.minimum(faces, after), np.maximum(faces, after)], axis=-1)


def _split(mesh: Tessellation, long: _LongEdges) -> Tessellation:
    """Every marked edge split in the middle, and its faces into two, three or four."""
    old, count = mesh.faces[long.faces], len(mesh.xyz)
    ends = _edges(old)[long.edges].astype(np.int64)
    keys, number = np.unique(ends[:, 0] * count + ends[:, 1], return_inverse=True)
    pairs = np.stack(np.divmod(keys, count), axis=1).astype(np.int32)
    middle = np.full(old.shape, -1, np.int32)
    middle[long.edges] = number + count
    kept = np.ones(len(mesh.faces), bool)
    kept[long.faces] = False
    faces, sources = [mesh.faces[kept]], [mesh.face_of[kept]]
    for corners, middles, chosen in _rotated(old, middle, long.edges):
        new = _pieces(corners, middles)
        faces.extend(new)
        sources.extend([mesh.face_of[long.faces[chosen]]] * len(new))
    xyz = np.concatenate([mesh.xyz, (mesh.xyz[pairs[:, 0]] + mesh.xyz[pairs[:, 1]]) / 2])
    return Tessellation(xyz, np.concatenate(faces), np.concatenate(sources), (*mesh.rounds, pairs))


def _rotated(
    faces: Integers, middle: Integers, long: NDArray[np.bool_]
) -> list[tuple[Integers, Integers, NDArray[np.intp]]]:
    """Corners, middles and numbers of the faces to split, turned so that split edges come first."""
    out = []
    for pattern in ((1, 0, 0), (1, 1, 0), (1, 1, 1)):
        for turn in range(1 if all(pattern) else 3):
            chosen = np.flatnonzero((long == np.roll(pattern, turn).astype(bool)).all(axis=1))
            turned = (np.roll(x[chosen], -turn, axis=1) for x in (faces, middle))
            out.append((*turned, chosen))
    return out  # type: ignore[return-value]


def _pieces(corners: Integers, middles: Integers) -> list[Integers]:
    """The new faces of faces whose first one, two or three edges are split."""
    a, b, c = corners.T
    ab, bc, ca = middles.T
    if not len(corners):
        return []
    if ca[0] >= 0:
        new = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    elif bc[0] >= 0:
        new = [(ab, b, bc), (a, ab, bc), (a, bc, c)]
    else:
        new = [(a, ab, c), (ab, b, c)]
    return [np.stack(face, axis=1) for face in new]
