"""From a distance field to a triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from skimage.measure import marching_cubes

from texproj.arrays import Floats
from texproj.demo.shapes import Field
from texproj.mesh import Mesh

BLOCK = 8
"""Cells along a block's side: fields are evaluated only in blocks that the surface may cross."""

CHUNK = 1 << 15
"""Points per evaluation, so that intermediate values stay in the processor's cache."""


def evaluate(field: Field, xyz: Floats) -> Floats:
    """(n,) values of a field at (n, 3) points, in chunks."""
    parts = [field(xyz[i : i + CHUNK]) for i in range(0, len(xyz), CHUNK)]
    return np.concatenate(parts) if parts else np.empty(0, np.float32)


def surface(field: Field, bounds: ArrayLike, faces: int) -> Mesh:
    """The zero level of a field inside (2, 3) bounds, in one piece of about `faces` triangles.

    Lorensen marching cubes (scikit-image) on a grid evaluated near the surface only; closed as
    long as the solid lies inside the bounds. A coarse trial tells the cell size.
    """
    low, high = np.asarray(bounds, float)
    trial = float((high - low).max() / 48)
    count = len(_marched(field, low, high, trial).faces)
    # The number of triangles goes with the inverse square of the cell size.
    return _largest(_marched(field, low, high, trial * np.sqrt(count / faces)))


def _largest(mesh: Mesh) -> Mesh:
    """The largest connected part: splinters that hang in the air and hidden bubbles go."""
    count = len(mesh.vertices)
    i, j = mesh.faces[:, [0, 1]].ravel(), mesh.faces[:, [1, 2]].ravel()
    joined = csr_matrix((np.ones(len(i), bool), (i, j)), (count, count))
    part = connected_components(joined, directed=False)[1]
    kept = part == np.bincount(part).argmax()
    number = np.cumsum(kept) - 1
    return Mesh(mesh.vertices[kept], number[mesh.faces[kept[mesh.faces[:, 0]]]])


def _marched(
    field: Field, low: NDArray[np.float64], high: NDArray[np.float64], cell: float
) -> Mesh:
    blocks = np.ceil((high - low) / (cell * BLOCK)).astype(int)
    grid = _narrow_band(field, low.astype(np.float32), blocks, np.float32(cell))
    vertices, faces, _, _ = marching_cubes(
        grid, 0.0, gradient_direction="descent", allow_degenerate=False
    )
    return Mesh(low + (vertices + 0.5) * cell, faces.astype(np.int32))


def _narrow_band(field: Field, low: Floats, blocks: NDArray[np.int_], cell: np.float32) -> Floats:
    """Field values at all cell centers; in blocks far from the surface the block's value."""
    side = cell * BLOCK
    index = np.stack(np.meshgrid(*map(np.arange, blocks), indexing="ij"), -1).reshape(-1, 3)
    middle = evaluate(field, low + (index.astype(np.float32) + 0.5) * side)
    values = np.repeat(middle, BLOCK**3).reshape(-1, BLOCK**3)
    # Half the diagonal of a block, and half again since carved fields are not exact distances.
    near = np.abs(middle) < 1.5 * (np.sqrt(3) / 2) * side
    inner = np.stack(np.meshgrid(*[np.arange(BLOCK)] * 3, indexing="ij"), -1).reshape(-1, 3)
    offsets = (inner.astype(np.float32) + 0.5) * cell
    corners = low + index[near].astype(np.float32) * side
    points = (corners[:, None] + offsets).reshape(-1, 3)
    values[near] = evaluate(field, points).reshape(-1, BLOCK**3)
    nested = values.reshape(*blocks, BLOCK, BLOCK, BLOCK).transpose(0, 3, 1, 4, 2, 5)
    return np.ascontiguousarray(nested.reshape(blocks * BLOCK))
