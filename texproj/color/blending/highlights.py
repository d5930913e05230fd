"""Highlights: what one photo shows brighter than most others, by light that has no color of the
surface.

The dichromatic model (Shafer, "Using color to separate reflection components", Color Research and
Application 1985): a gloss adds light of the source's color, neutral after white balance, to that of
the surface. A photo that is merely brighter adds light of the surface's color. On gray surfaces the
two look alike, and what is brighter counts as a highlight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.photo import LUMINANCE

SCALE = 0.1
"""How much brighter than the median, in square roots of linear light (1 = white), a highlight is
that halves the weight at strength 1."""

COLORED, NEUTRAL = 0.9, 0.98
"""Cosine between added light and gray up to which it has the surface's color, and from which on it
is the light's."""

WITNESSES = 3
"""Photos that must see a point."""


def highlight_factor(rgb: Floats, weight: Floats, strength: float) -> Floats:
    """(p, n) factor on the weights: 1, or less where a photo shows a highlight.

    rgb: (p, 3, n) linear light, brought to the same exposure; weight: (p, n), 0 = unseen.
    """
    light = np.sqrt(np.einsum("c,pcn->pn", LUMINANCE, rgb))
    usual = median_view(light, weight)
    index = np.broadcast_to(usual[None, None], (1, 3, len(usual)))
    added = rgb - np.take_along_axis(rgb, index, axis=0)
    brighter = light - np.take_along_axis(light, usual[None], axis=0)
    length = np.sqrt(np.einsum("pcn,pcn->pn", added, added))
    cosine = added.sum(axis=1) / np.maximum(length, 1e-6) / np.float32(np.sqrt(3))
    neutral = np.clip((cosine - COLORED) / (NEUTRAL - COLORED), 0, 1)
    over = np.maximum(brighter, 0) * np.float32(1 / SCALE)
    judged = np.count_nonzero(weight, axis=0) >= WITNESSES
    return (1 / (1 + np.float32(strength) * over * over * neutral * judged)).astype(np.float32)


def median_view(values: Floats, weight: Floats) -> NDArray[np.intp]:
    """(n,) number of the view that shows the weighted median of (p, n) values."""
    order = np.argsort(np.where(weight > 0, values, np.inf), axis=0)
    part = np.cumsum(np.take_along_axis(weight, order, axis=0), axis=0)
    row = np.argmax(part >= 0.5 * part[-1], axis=0)
    return np.take_along_axis(order, row[None], axis=0)[0]
