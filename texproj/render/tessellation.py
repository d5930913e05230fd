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
        longest = np.zeros(len(self.xyz), np.float32)
        for i in range(3):
            ends = self.faces[:, i], self.faces[:, i - 1]
            length = np.linalg.norm(self.xyz[ends[0]] - self.xyz[ends[1]], axis=1)
            for end in ends:
                np.maximum.at(longest, end, length)
        return longest

    def largest_span(self, view: Viewpoint) -> float:
        """A bound on the angle (rad) that any edge not behind the camera spans, seen from there."""
        from_center = self.xyz - view.center
        before = from_center @ view.axis > -self.reach
        distance = np.linalg.norm(from_center, axis=1) - self.reach
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
            if not long.any() or len(out.faces) > len(self.faces) + MOST_NEW_FACES:
                break
            out = _split(out, long)
        return out


def _long_edges(mesh: Tessellation, view: Viewpoint, max_span: float) -> NDArray[np.bool_]:
    """(G, 3) whether the edge from corner i to corner i + 1 is to be split; both faces agree."""
    long = np.zeros(mesh.faces.shape, bool)
    slack = np.maximum(np.linalg.norm(mesh.xyz - view.center, axis=1) - mesh.reach, view.nearest)
    suspects = np.flatnonzero((mesh.reach > max_span * slack)[mesh.faces].any(axis=1))
    ends = _edges(mesh.faces[suspects]).reshape(-1, 2)
    a, b = mesh.xyz[ends[:, 0]] - view.center, mesh.xyz[ends[:, 1]] - view.center
    along = b - a
    length2 = np.maximum(np.einsum("ij,ij->i", along, along), np.float32(1e-30))
    nearest = a + along * np.clip(-np.einsum("ij,ij->i", a, along) / length2, 0, 1)[:, None]
    distance = np.maximum(np.linalg.norm(nearest, axis=1), view.nearest)
    before = np.maximum(a @ view.axis, b @ view.axis) > 0
    long[suspects] = (before & (np.sqrt(length2) > max_span * distance)).reshape(-1, 3)
    return long


def _edges(faces: Integers) -> Integers:
    """(n, 3, 2) ends of the edges of faces (n, 3), the smaller number first."""
    return np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)


def _split(mesh: Tessellation, long: NDArray[np.bool_]) -> Tessellation:
    """Every marked edge split in the middle, and its faces into two, three or four."""
    pairs, number = np.unique(_edges(mesh.faces)[long], axis=0, return_inverse=True)
    middle = np.full(long.shape, -1, np.int32)
    middle[long] = number.ravel() + len(mesh.xyz)
    kept = ~long.any(axis=1)
    faces, sources = [mesh.faces[kept]], [mesh.face_of[kept]]
    for corners, middles, source in _rotated(mesh.faces, middle, long):
        new = _pieces(corners, middles)
        faces.extend(new)
        sources.extend([mesh.face_of[source]] * len(new))
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
