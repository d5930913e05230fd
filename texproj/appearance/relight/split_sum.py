"""What a GGX mirror gives back of light that is the same from everywhere."""

from __future__ import annotations

from functools import cache

import numpy as np

from texproj.appearance.flash.reflection import Angles, lobe
from texproj.arrays import Floats

CELLS = 32
SAMPLES = 256


def split_sum(nv: Floats, roughness: Floats) -> tuple[Floats, Floats]:
    """(n,) and (n,): F0 times the first, plus the second, is mirrored. nv: (n,) cosine to the eye.

    B. Karis, "Real shading in Unreal Engine 4", 2013, for the lobe that `flash.reflection` fits.
    """
    table = _table()
    x, y = (np.clip(v, 0, 1) * np.float32(CELLS - 1) for v in (nv, roughness))
    x0, y0 = (np.minimum(v.astype(np.intp), CELLS - 2) for v in (x, y))
    right, below = (x - x0)[:, None], (y - y0)[:, None]
    upper = table[y0, x0] * (1 - right) + table[y0, x0 + 1] * right
    lower = table[y0 + 1, x0] * (1 - right) + table[y0 + 1, x0 + 1] * right
    scale, bias = (upper * (1 - below) + lower * below).T
    return scale, bias


@cache
def _table() -> Floats:
    """(roughness, nv, 2), each from 0 to 1."""
    steps = np.linspace(0, 1, CELLS, dtype=np.float32)
    return np.stack([_row(np.maximum(steps, np.float32(0.02)), max(r, 0.05)) for r in steps])


def _row(nv: Floats, roughness: float) -> Floats:
    """(n, 2) by sampling the facets (Walter et al. 2007, eq. 35, 41)."""
    number = np.arange(SAMPLES)
    u, turn = (number + 0.5) / SAMPLES, number * np.pi * (3 - np.sqrt(5))
    cosine = np.sqrt((1 - u) / (1 + (roughness**4 - 1) * u))
    across = np.sqrt(1 - cosine**2)
    to_eye = np.sqrt(1 - nv**2)
    vh = np.maximum(to_eye[:, None] * across * np.cos(turn) + nv[:, None] * cosine, 1e-6)
    nl = 2 * vh * cosine - nv[:, None]
    seen = nl > 0
    ones = np.ones_like(vh)
    angles = Angles(*(a.astype(np.float32) for a in (
        np.where(seen, nl, 1), nv[:, None] * ones, cosine * ones, vh,
    )))  # fmt: skip
    spread = cosine**2 * (roughness**4 - 1) + 1
    density = roughness**4 / (np.pi * spread**2)
    weight = np.where(seen, lobe(roughness, angles) / density * 4 * vh * nl / cosine, 0)
    edge = (1 - vh) ** 5
    parts = [(weight * (1 - edge)).mean(axis=1), (weight * edge).mean(axis=1)]
    return np.stack(parts, axis=1).astype(np.float32)
