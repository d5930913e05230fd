"""Colors for what no photo sees, from what is around it: a membrane over the surface.

The colors at the border of what is seen are continued as a harmonic function (Pinkall and Polthier,
"Computing discrete minimal surfaces", 1993, have the weights): no jump at the border, no extremum
inside, and detail of the border fades the faster the finer it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import cg, spsolve

from texproj.arrays import Floats
from texproj.mesh import Mesh

LEAST, MOST = 0.05, 5.0
"""Bounds of the cotangents: slivers of a scan would else make weights that are negative or
endless."""

PULL = 1e-6
"""By which each vertex is drawn to its `home`, part of the mean weight: decides for parts that
touch nothing seen, and nothing else."""

COARSEST = 1000
"""Unknowns that are solved for at once."""

ROUNDS, TOLERANCE = 30, 1e-4
"""Of conjugate gradients at each resolution; beyond, no 8-bit color changes."""

NEIGHBORS, SOME = 32, 50_000
"""Seen vertices that give a detached part its color, of so many."""

Matrix = Any
"""scipy.sparse.csr_array"""


def fill_vertices(mesh: Mesh, rgb: Floats, seen: NDArray[np.bool_]) -> Floats:
    """(V, 3) colors, of unseen vertices those of a membrane that hangs on the seen ones; parts of
    the mesh that no photo sees at all take the mean of what is seen nearest to them.

    rgb: in any encoding, which is that of the average; close to what an eye sees is best.
    """
    out = np.where(seen[:, None], rgb, 0).astype(np.float32)
    if seen.all() or not seen.any():
        return out
    weights = _weights(mesh, seen)
    unknown = np.flatnonzero(~seen)
    rows = weights[unknown]
    inner, outer = rows[:, unknown].tocsr(), rows[:, np.flatnonzero(seen)].tocsr()
    home = _homes(mesh, out, seen, inner, outer)
    degree = np.asarray(inner.sum(axis=1)).ravel() + np.asarray(outer.sum(axis=1)).ravel()
    pull = PULL * max(float(degree.mean()), 1e-12)
    matrix = (sparse.diags_array(degree + pull) - inner).tocsr()
    given = outer @ rgb[seen].astype(np.float64) + pull * home
    colors = _solved(matrix, given)
    out[unknown] = colors.clip(rgb[seen].min(axis=0), rgb[seen].max(axis=0))
    return out


def _weights(mesh: Mesh, seen: NDArray[np.bool_]) -> Matrix:
    """(V, V) cotangent weights of the edges of faces that have an unseen corner."""
    faces = mesh.faces[~seen[mesh.faces].all(axis=1)]
    xyz = mesh.vertices[faces] - mesh.center
    ends, values = [], []
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        p, q = xyz[:, one] - xyz[:, k], xyz[:, two] - xyz[:, k]
        across = np.linalg.norm(np.cross(p, q), axis=1)
        cotangent = np.einsum("ij,ij->i", p, q) / np.maximum(across, 1e-300)
        ends.append(faces[:, [one, two]])
        values.append(cotangent.clip(LEAST, MOST))
    (row, column), value = np.concatenate(ends).T, np.concatenate(values)
    shape = (len(mesh.vertices),) * 2
    half = sparse.coo_array((value, (row, column)), shape=shape)
    return (half + half.T).tocsr()


def _homes(
    mesh: Mesh, rgb: Floats, seen: NDArray[np.bool_], inner: Matrix, outer: Matrix
) -> NDArray[np.float64]:
    """(n, 3) for each unseen vertex the color of what is seen nearest to its part of the mesh,
    where that part touches nothing seen; else the mean of all that is seen.
    """
    home = np.tile(rgb[seen].mean(axis=0, dtype=np.float64), (inner.shape[0], 1))
    count, part = connected_components(inner, directed=False)
    touching = np.bincount(part, np.diff(outer.indptr), count) > 0
    lone = np.flatnonzero(~touching[part])
    if not len(lone):
        return home
    from scipy.spatial import cKDTree  # noqa: PLC0415 - slow to load

    size = np.bincount(part[lone], minlength=count)
    xyz = mesh.vertices[np.flatnonzero(~seen)[lone]]
    middle = np.stack([np.bincount(part[lone], x, count) for x in xyz.T], axis=1)
    some = np.flatnonzero(seen)[:: max(1, int(seen.sum()) // SOME)]
    apart = np.flatnonzero(size)
    near = cKDTree(mesh.vertices[some]).query(
        middle[apart] / size[apart, None], min(NEIGHBORS, len(some))
    )[1]
    color = np.zeros((count, 3))
    color[apart] = rgb[some[near.reshape(len(apart), -1)]].mean(axis=1)
    home[lone] = color[part[lone]]
    return home


@dataclass(frozen=True, eq=False)
class _Level:
    """matrix (n, n) and given (n, k) of a system; parent: (n,) its unknowns one level coarser."""

    matrix: Matrix
    given: NDArray[np.float64]
    parent: NDArray[np.int64]


def _solved(matrix: Matrix, given: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, k) solution of matrix @ x = given, for a Laplacian: cascadic conjugate gradients
    (Deuflhard 1994), coarse to fine, over groups of neighbors.
    """
    levels: list[_Level] = []
    while matrix.shape[0] > COARSEST:
        parent = _grouped(matrix)
        count = int(parent.max()) + 1
        if count > 0.8 * len(parent):
            break  # hardly anything is connected
        levels.append(_Level(matrix, given, parent))
        ones = (np.ones(len(parent)), (np.arange(len(parent)), parent))
        spread = sparse.csr_array(ones, shape=(len(parent), count))
        matrix, given = (spread.T @ matrix @ spread).tocsr(), spread.T @ given
    if matrix.shape[0] <= COARSEST:
        x = np.asarray(spsolve(matrix.tocsc(), given)).reshape(given.shape)
    else:
        x = _improved(matrix, given, given / matrix.diagonal()[:, None])
    for level in reversed(levels):
        x = _improved(level.matrix, level.given, x[level.parent])
    return x


def _improved(
    matrix: Matrix, given: NDArray[np.float64], x: NDArray[np.float64]
) -> NDArray[np.float64]:
    jacobi = sparse.diags_array(1 / matrix.diagonal())
    columns = [
        cg(matrix, b, start, rtol=TOLERANCE, maxiter=ROUNDS, M=jacobi)[0]
        for b, start in zip(given.T, x.T, strict=True)
    ]
    return np.stack(columns, axis=1)


def _grouped(matrix: Matrix) -> NDArray[np.int64]:
    """(n,) number of a group of neighbors for each unknown: each goes with the neighbor, or itself,
    that drew the largest number.
    """
    count = matrix.shape[0]
    drawn = np.random.default_rng(1).permutation(count)
    best = np.maximum.reduceat(drawn[matrix.indices], matrix.indptr[:-1])  # the diagonal is there
    return np.unique(best, return_inverse=True)[1].astype(np.int64)
