"""Where points are between the corners of their faces."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Floats


def barycentric(corners: Floats, xyz: Floats) -> Floats:
    """(n, 3) weights of the corners (n, 3, 3) of faces for points near them, in 0..1."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    e, f, p = b - a, c - a, xyz - a
    ee, ff, ef = (np.einsum("ij,ij->i", u, v) for u, v in ((e, e), (f, f), (e, f)))
    pe, pf = np.einsum("ij,ij->i", p, e), np.einsum("ij,ij->i", p, f)
    det = ee * ff - ef * ef
    det = np.where(det > 0, det, np.float32(np.inf))
    u, v = (ff * pe - ef * pf) / det, (ee * pf - ef * pe) / det
    part = np.maximum(np.stack([1 - u - v, u, v], axis=1), 0)
    return part / part.sum(axis=1, keepdims=True)
