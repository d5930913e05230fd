"""The light around a point of a photo, read further up its image pyramid, so that no point has to
know its neighbors.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.sampling.pixel_lookup import by_level, rescaled
from texproj.color.sampling.view import PhotoView, linear16
from texproj.photo import LUMINANCE

OCTAVES = 2
"""Levels of the pyramid between a point's color and the light around it: a base of 4 pixels, over
which photos may be off by a pixel or two and still show the same."""

AROUND_ONE = 16384
"""The 16-bit value of equal light at and around a point; 4 times as much is the most."""


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
