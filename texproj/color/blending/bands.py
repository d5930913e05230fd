"""Two frequency bands of what photos show, point by point: the light around a point comes from
further up the photo's image pyramid, so that no point has to know its neighbors.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.sampling.pixel_lookup import by_level, rescaled
from texproj.color.sampling.view import PhotoView, linear16

OCTAVES = 2
"""Levels of the pyramid between a point's color and the light around it: a base of 4 pixels, over
which photos may be off by a pixel or two and still show the same."""

AROUND_ONE = 16384
"""The 16-bit value of equal light at and around a point; 4 times as much is the most."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear sRGB (Rec. 709)."""

STRONGEST = np.float32(1.5)
"""Most by which detail is strengthened."""

NOISE = np.float32(1e-6)
"""Square of the detail (in square roots of linear light) that rounding to 8 bits makes."""


def soft_light(levels: tuple[NDArray[Any], ...]) -> tuple[Floats, ...]:
    """For each level of a pyramid the (h, w) square root of the luminance `OCTAVES` above it."""
    last = len(levels) - 1
    made = {k: _root_light(linear16(levels[k])) for k in range(min(OCTAVES, last), last + 1)}
    return tuple(made[min(k + OCTAVES, last)] for k in range(len(levels)))


def light_around(
    view: PhotoView, rgb: NDArray[np.uint16], xy_px: Floats, level: NDArray[np.int8] | None
) -> NDArray[np.uint16]:
    """(rows * ROW,) light around points against their own (`AROUND_ONE`), as square roots.

    rgb: (rows, ROW, 3) colors read at `xy_px`, each from its pyramid level, as by `read_colors`.
    A ratio stays the same whatever factor the photo is corrected by.
    """

    def read(maps: Floats, number: int) -> Floats:
        image = view.soft[number]
        maps = rescaled(maps, image.shape, view.camera)
        return cv2.remap(image, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

    soft = by_level(read, xy_px, level)
    own = np.maximum(_root_light(rgb), np.float32(1))
    ratio: NDArray[np.uint16] = cv2.divide(soft, own, scale=AROUND_ONE, dtype=cv2.CV_16U)
    return ratio.reshape(-1)


def _root_light(rgb: NDArray[np.uint16]) -> Floats:
    """(h, w) float32."""
    return np.sqrt(cv2.transform(rgb, LUMINANCE[None]), dtype=np.float32)


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
    return lit(rgb, np.minimum(strength - 1, STRONGEST - 1) * sure * mean)


def exchanged(rgb: Floats, trust: Floats, sharp: Floats, detail: Floats) -> Floats:
    """(n, 3) colors averaged by `trust`, with the details averaged by `sharp` in place of theirs;
    both (p, n), sum to 1.
    """
    return lit(rgb, np.einsum("pn,pn->n", sharp - trust, detail))


def lit(rgb: Floats, extra: Floats) -> Floats:
    """(n, 3) colors with so much more light, (n,) in square roots."""
    light = np.sqrt(np.einsum("nc,c->n", rgb, LUMINANCE))
    factor = 1 + extra / np.maximum(light, np.float32(0.02))
    return rgb * np.square(np.clip(factor, 0.5, 2))[:, None]
