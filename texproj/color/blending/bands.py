"""Fine detail and the light around it, blended apart: detail gets back what averaging weakens."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Floats
from texproj.photo import LUMINANCE

STRONGEST = np.float32(1.5)
"""Most by which detail is strengthened."""

NOISE = np.float32(1e-6)
"""Square of the detail (in square roots of linear light) that rounding to 8 bits makes."""


def restored(rgb: Floats, trust: Floats, detail: Floats) -> Floats:
    """(n, 3) averaged colors with details as strong as the photos show them.

    trust: (p, n), sums to 1; detail: (p, n) light at the point less the light around it, square
    roots. The average of details that are a little apart is too weak, while its place and sign are
    right: it is brought to the photos' root mean square as far as it stands above its own standard
    error, so that what is noise in each photo stays averaged out. Ours.
    """
    part = trust * detail
    mean = part.sum(axis=0)
    power = np.einsum("pn,pn->n", part, detail)
    parts = np.einsum("pn,pn->n", trust, trust)
    least = mean * mean + NOISE
    strength = np.sqrt(np.maximum(power / least, 1))
    error = np.maximum(power - least, 0) * parts / np.maximum(1 - parts, np.float32(0.1))
    sure = np.maximum(1 - error / least, 0)
    return with_light(rgb, np.minimum(strength - 1, STRONGEST - 1) * sure * mean)


def exchanged(rgb: Floats, trust: Floats, sharp: Floats, detail: Floats) -> Floats:
    """(n, 3) colors averaged by `trust`, with the details averaged by `sharp` in place of theirs;
    both (p, n), sum to 1.
    """
    return with_light(rgb, np.einsum("pn,pn->n", sharp - trust, detail))


def with_light(rgb: Floats, extra: Floats) -> Floats:
    """(n, 3) colors with so much more light, (n,) in square roots."""
    light = np.sqrt(np.einsum("nc,c->n", rgb, LUMINANCE))
    factor = 1 + extra / np.maximum(light, np.float32(0.02))
    return rgb * np.square(np.clip(factor, 0.5, 2))[:, None]
