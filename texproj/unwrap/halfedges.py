"""The sides of triangles, each in the direction of its face; sorted by counting, which takes one
pass over them where comparing takes many.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from texproj.arrays import Bools, Rows

SPARSE = 4
"""Possible keys for each that there is from which comparing is faster than counting."""


def stable_order(keys: Rows, count: int) -> Rows:
    """(n,) the rows of (n,) keys in ascending order, equal ones as they come; 0 <= keys < count.

    A matrix with one entry a row turns from rows to columns by counting (scipy).
    """
    if count > SPARSE * len(keys):
        return np.argsort(keys, kind="stable").astype(np.int32)
    starts = np.arange(len(keys) + 1, dtype=np.int32)
    ones, columns = np.ones(len(keys), np.int8), keys.astype(np.int32, copy=False)
    matrix = sparse.csr_array((ones, columns, starts), shape=(len(keys), count))
    return matrix.tocsc().indices.astype(np.int32, copy=False)


def ordered(
    major: Rows,
    minor: Rows,
    majors: int,
    minors: int,
) -> tuple[Rows, Bools]:
    """(n,) the rows sorted by `major`, then by `minor`, equal ones as they come; and (n,) whether
    the pair in each place differs from the one before it. major < majors, minor < minors.
    """
    order = stable_order(minor, minors)
    order = order[stable_order(major[order], majors)]
    new = np.ones(len(order), bool)
    for keys in (major[order], minor[order]):
        new[1:] &= keys[1:] == keys[:-1]
    new[1:] = ~new[1:]
    return order, new


def half_edges(faces: Rows) -> tuple[Rows, Rows]:
    """(3 F,) first and last vertex of each side of (F, 3) faces, face by face."""
    faces = faces.astype(np.int32, copy=False)
    return faces.ravel(), faces[:, [1, 2, 0]].ravel()


def opposite(start: Rows, end: Rows, count: int) -> tuple[Rows, Rows]:
    """(m,) and (m,) half-edges that are alone at their edge and run through it in opposite
    directions, by the edges' vertices; the first comes first. start, end: (n,) vertices < count.
    """
    order, new = ordered(np.minimum(start, end), np.maximum(start, end), count, count)
    first = np.flatnonzero(new)
    twice = first[np.diff(first, append=len(order)) == 2]
    one, two = order[twice], order[twice + 1]
    inner = start[one] == end[two]
    return one[inner], two[inner]
