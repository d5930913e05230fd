"""Make any triangle soup fit for every method, count what was done, keep the way back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from texproj.errors import InputError
from texproj.layout import Layout
from texproj.mesh import Mesh, MeshSource, blocks, by_blocks, norms

Index = NDArray[np.int64]
Bools = NDArray[np.bool_]

COARSE = 0.1
"""Steps of single precision, over the usual edge, from which a mesh has lost its shape."""

MOST_SAMPLED = 200_000
"""Faces from which the usual edge is taken."""

ROUNDING = 4 * np.finfo(np.float64).eps
"""Height of a triangle, over its largest coordinate, that rounding alone can make."""


def repair(vertices: ArrayLike, faces: ArrayLike, layout: Layout | None = None) -> MeshSource:
    """The usable part of a mesh: welded, without broken, degenerate, duplicate or unused parts.

    vertices: (S, 3) mesh units, any finite or non-finite values; faces: (T, 3) integers; layout:
    where these faces lie in textures.
    No vertex moves: only exactly equal positions are welded. Vertices and faces keep their
    order, so that a clean mesh comes back as it is; `source_faces` and `mesh.faces` of the
    result pair up row by row. Of several faces on the same three points the first stays,
    whichever way the others turn. Raises InputError where no face is left.
    """
    source = np.ascontiguousarray(vertices, np.float64).reshape(-1, 3)
    given = np.asarray(faces).reshape(-1, 3)
    if not len(given):
        raise InputError("the mesh has no faces (a point cloud?): give one with triangles")
    finite: Bools = np.asarray(np.isfinite(source).all(axis=1))
    welded = first_equal_rows(np.where(finite[:, None], source, 0.0) + 0.0)
    welded[~finite] = -1
    valid, repairs = _valid_faces(source, given, welded)
    kept = (given if len(valid) == len(given) else given[valid]).astype(np.int32, copy=False)
    if not len(kept):
        told = ", ".join(f"{count} {name}" for name, count in repairs.items() if count)
        raise InputError(f"the mesh has no usable face: {told}")
    used = np.zeros(len(source), bool)
    for rows in blocks(len(kept)):
        used[welded[kept[rows]]] = True
    repairs = _vertex_counts(finite, welded, used) | repairs
    kept_layout = layout and layout.of_faces(valid)
    if used.all():  # the file's own arrays, once in memory
        vertex_of_source = np.arange(len(source), dtype=np.int32)
        mesh = Mesh(source, kept, kept_layout)
    else:
        new_index = np.cumsum(used) - 1
        vertex_of_source = np.where(
            (welded >= 0) & used[welded], new_index[welded], -1
        ).astype(np.int32)  # fmt: skip
        mesh = Mesh(source[used], vertex_of_source[kept], kept_layout)
    done = {name: count for name, count in repairs.items() if count}
    return MeshSource(mesh, source, kept, vertex_of_source, done, _precision(mesh))


def _precision(mesh: Mesh) -> tuple[str, ...]:
    """A warning where the coordinates come from single precision that was too coarse for them."""
    xyz = mesh.vertices
    with np.errstate(over="ignore"):
        single = xyz.astype(np.float32)
    if not np.isfinite(single).all() or not (single == xyz).all():
        return ()
    step = float(np.spacing(np.abs(single).max()))
    rows = mesh.faces[:: max(1, len(mesh.faces) // MOST_SAMPLED)]
    edge = float(np.median(norms(xyz[rows[:, 0]] - xyz[rows[:, 1]])))
    if step < COARSE * edge:
        return ()
    return (
        f"its coordinates are so large that single precision rounds them to steps of {step:.3g},"
        f" while its edges are about {edge:.3g} long: export it in double precision, or near the"
        " origin",
    )


def first_equal_rows(rows: NDArray[np.float64] | NDArray[np.integer[Any]]) -> Index:
    """(n,) for each of (n, k) rows the index of the first row that is bitwise equal.

    Ours: sorted by a 64-bit hash, then compared; a hash collision (odds 1e-7 for a million rows)
    could at worst leave an equal pair unfound.
    """
    hashes = by_blocks(len(rows), lambda part: _hash(_words(rows[part])))
    order = np.argsort(hashes, kind="stable")
    hashes = hashes[order]
    alike = np.flatnonzero(hashes[1:] == hashes[:-1])
    one, two = _words(rows[order[alike]]), _words(rows[order[alike + 1]])
    alike = alike[(one == two).all(axis=1)]
    if not len(alike):
        return np.arange(len(rows))
    starts = np.ones(len(rows), bool)
    starts[alike + 1] = False
    result = np.empty(len(rows), np.int64)
    result[order] = order[starts][np.cumsum(starts) - 1]
    return result


def _words(rows: NDArray[Any]) -> NDArray[np.uint64]:
    """(n, k) the same rows as 64 bits each."""
    wide = rows if rows.itemsize == 8 else rows.astype(np.int64)
    return np.ascontiguousarray(wide).view(np.uint64)


def _hash(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """(n,) well mixed 64 bits of each (n, k) row; the finalizer of MurmurHash3 after each word."""
    mixed = np.zeros(len(words), np.uint64)
    for column in words.T:
        mixed = mixed * np.uint64(0x9E3779B97F4A7C15) + column
        for factor in (0xFF51AFD7ED558CCD, 0xC4CEB9FE1A85EC53):
            mixed = (mixed ^ (mixed >> np.uint64(33))) * np.uint64(factor)
        mixed ^= mixed >> np.uint64(33)
    return mixed


def _valid_faces(
    source: NDArray[np.float64], faces: NDArray[np.integer[Any]], welded: Index
) -> tuple[Index, dict[str, int]]:
    """Rows of `faces` that can be used, ascending, and what the others suffered from."""
    repairs: dict[str, int] = {}
    rows = np.arange(len(faces))

    def keep(good: Bools, name: str) -> None:
        nonlocal rows
        repairs[name] = int(len(good) - np.count_nonzero(good))
        rows = rows if not repairs[name] else rows[good]

    def each(of_faces: Callable[[NDArray[np.integer[Any]]], NDArray[Any]]) -> NDArray[Any]:
        return by_blocks(len(rows), lambda part: of_faces(faces[rows[part]]))

    keep(
        each(lambda some: np.asarray(((some >= 0) & (some < len(source))).all(axis=1))),
        "faces out of range",
    )
    keep(each(lambda some: ~(welded[some] < 0).any(axis=1)), "faces with non-finite vertices")
    keep(each(lambda some: _has_area(source, welded[some])), "degenerate faces")
    corners = each(lambda some: np.sort(welded[some].astype(np.int32), axis=1))
    keep(first_equal_rows(corners) == np.arange(len(corners)), "duplicate faces")
    return rows, repairs


def _has_area(vertices: NDArray[np.float64], faces: Index) -> Bools:
    """(F,) whether each triangle is higher than the rounding of its own coordinates."""
    a, b, c = (vertices[corner] for corner in faces.T)
    largest = np.maximum(np.maximum(np.abs(a), np.abs(b)), np.abs(c)).max(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):  # coordinates of 1e200 are no triangle
        base2 = np.maximum(_norm2(b - a), np.maximum(_norm2(c - b), _norm2(a - c)))
        height2 = (ROUNDING * largest) ** 2
        return np.asarray(_norm2(np.cross(b - a, c - a)) > base2 * height2)


def _norm2(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("ij,ij->i", vectors, vectors)


def _vertex_counts(finite: Bools, welded: Index, used: Bools) -> dict[str, int]:
    """What happened to vertices: broken, merged into an earlier one, or in no valid face."""
    first = welded == np.arange(len(welded))
    return {
        "non-finite vertices": int(np.count_nonzero(~finite)),
        "welded vertices": int(np.count_nonzero(finite & ~first)),
        "unreferenced vertices": int(np.count_nonzero(first & ~used)),
    }
