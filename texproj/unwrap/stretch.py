"""How the map from surface to texture stretches each face."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.mesh import by_blocks


def signed_areas(uv: Doubles, faces: NDArray[np.integer[Any]]) -> Doubles:
    """(F,) areas of the faces in the plane, negative where turned over."""

    return by_blocks(len(faces), lambda rows: signed_area(uv[faces[rows]]))


def signed_area(uv_corners: Doubles) -> Doubles:
    """(F,) areas of (F, 3, 2) triangles in the plane, negative where turned over."""
    p, q = uv_corners[:, 1] - uv_corners[:, 0], uv_corners[:, 2] - uv_corners[:, 0]
    out: Doubles = 0.5 * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
    return out


def flat_areas(uv: Doubles, faces: NDArray[np.integer[Any]]) -> Doubles:
    """(F,) areas of the faces in the plane, positive."""
    return np.abs(signed_areas(uv, faces))


def stretch(corners: Doubles, uv_corners: Doubles) -> Doubles:
    """(F,) ratio >= 1 of the singular values of the linear map of each face.

    corners: (F, 3, 3) in space; uv_corners: (F, 3, 2). The squares of the singular values are
    the eigenvalues of inv(G) H with G, H the Gram matrices of two edges in space and plane.
    """
    g, h = _gram(corners), _gram(uv_corners)
    determinant = np.maximum(g[0] * g[2] - g[1] ** 2, 1e-300)
    half_trace = 0.5 * (g[2] * h[0] - 2 * g[1] * h[1] + g[0] * h[2]) / determinant
    product = np.maximum(h[0] * h[2] - h[1] ** 2, 0) / determinant
    root = np.sqrt(np.maximum(half_trace**2 - product, 0))
    larger = half_trace + root
    return larger / np.sqrt(np.maximum(np.maximum(product, 1e-24 * larger**2), 1e-300))


def weighted_quantiles(values: Doubles, weights: Doubles, at: tuple[float, ...]) -> list[float]:
    """The values below which the given shares of the weight lie."""
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    rows = np.searchsorted(share, np.array(at) * share[-1])
    return [float(values[order[min(row, len(order) - 1)]]) for row in rows]


def _gram(corners: Doubles) -> tuple[Doubles, Doubles, Doubles]:
    p, q = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return _dot(p, p), _dot(p, q), _dot(q, q)


def _dot(p: Doubles, q: Doubles) -> Doubles:
    """(F,) products of rows, column by column, which is faster than along them."""
    out: Doubles = p[:, 0] * q[:, 0]
    for k in range(1, p.shape[1]):
        out += p[:, k] * q[:, k]
    return out
