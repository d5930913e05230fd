"""Colors for what no photo sees, from what is around it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.mesh import Mesh


def fill_vertices(mesh: Mesh, rgb: Floats, seen: NDArray[np.bool_]) -> Floats:
    """(V, 3) colors: unseen vertices take the mean of their neighbors, ring by ring from the seen
    ones inwards; parts of the mesh that no photo sees at all take the mean of all seen vertices.
    """
    out = np.where(seen[:, None], rgb, 0).astype(np.float32)
    if seen.all() or not seen.any():
        return out
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    edges = np.concatenate([edges, edges[:, ::-1]])
    edges = edges[~seen[edges[:, 0]]]
    known = seen.copy()
    while len(edges):
        reach = known[edges[:, 1]]
        if not reach.any():
            break
        target, source = edges[reach].T
        count = np.bincount(target, minlength=len(out)).astype(np.float32)
        new = np.flatnonzero(count)
        for channel in range(3):
            total = np.bincount(target, out[source, channel], len(out))
            out[new, channel] = total[new] / count[new]
        known[new] = True
        edges = edges[~known[edges[:, 0]]]
    out[~known] = rgb[seen].mean(axis=0)
    return out
