"""Photos as the joint refinement compares them: luma, reduced, kept small."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.photo import Photo
from texproj.register.joint.looking import looked_up

WHITE = 65535
"""Luma is kept in 16 bits: half of float32, and finer than any photo."""


@dataclass(frozen=True, eq=False)
class GrayPhoto:
    """pixels: (h, w) uint16 luma, sRGB-encoded, 65535 = white; mask: (h, w) uint8 or None,
    0 = do not use.
    """

    pixels: NDArray[np.uint16]
    mask: NDArray[np.uint8] | None

    @classmethod
    def of(cls, photo: Photo) -> GrayPhoto:
        luma = np.clip(photo.gray(), 0, 1) * np.float32(WHITE) + np.float32(0.5)
        return cls(luma.astype(np.uint16), photo.mask)

    @property
    def width(self) -> int:
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        return int(self.pixels.shape[0])

    def luma(self) -> Floats:
        """(h, w) float32 in 0..1."""
        return self.pixels * np.float32(1 / WHITE)

    def at(self, places: Floats) -> Floats:
        """(n, m) float32 luma in 0..1 at (2, n, m) places x, y as OpenCV counts them."""
        luma = looked_up(self.pixels, places, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE)
        return luma * np.float32(1 / WHITE)

    def reduced(self, longest_px: int) -> GrayPhoto:
        """With the longer side reduced to `longest_px`, itself if it is smaller."""
        factor = longest_px / max(self.width, self.height)
        if factor >= 1:
            return self
        size = (max(1, round(self.width * factor)), max(1, round(self.height * factor)))
        mask = self.mask
        if mask is not None:
            mask = cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST_EXACT)
        return GrayPhoto(cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA), mask)
