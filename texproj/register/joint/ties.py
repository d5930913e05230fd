"""Ties between two photos: patches of one, seen through the mesh from the other, found there."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats, Index
from texproj.solve.joint import Ties
from texproj.solve.orientation import DARK, PRE_BLUR_PX, Field

PATCH_PX = 15
STEP_PX = 24
"""One patch in each square of this size: the most corner-like."""
RIM_PX = PATCH_PX // 2 + 1
LEAST_SCORE = 0.75
"""Normalized correlation of signed gradients at which a patch counts as found."""
DEPTH_TOLERANCE = 0.01
"""The other photo sees the same surface if the depths agree to this part."""
LEAST_SLANT = 0.2
"""Cosine between ray and normal below which a point's depth says too little about its place."""


@dataclass(frozen=True, eq=False)
class TieSearch:
    """Ties found between two photos, and how many were sought: patches on surface both see."""

    ties: Ties
    sought: int

    @property
    def support(self) -> float:
        """Share of the patches that were found."""
        return len(self.ties) / max(self.sought, 1)


def gradient_field(gray: Floats) -> Field:
    """(h, w) complex: gradient of the logarithm, so that exposure does not matter."""
    smooth = cv2.GaussianBlur(np.log(gray + np.float32(DARK)), (0, 0), PRE_BLUR_PX)
    out = np.empty(gray.shape, np.complex64)
    out.real = cv2.Scharr(smooth, cv2.CV_32F, 1, 0, scale=1 / 32)
    out.imag = cv2.Scharr(smooth, cv2.CV_32F, 0, 1, scale=1 / 32)
    return out


def corner_grid(corners: Floats, valid: NDArray[np.bool_], step_px: int = STEP_PX) -> Index:
    """(n, 2) x, y of the most corner-like valid pixel of each square of the grid, but for squares
    with less than half the structure of the median one (nothing there can be located).
    """
    strength = np.where(valid, corners, 0)
    h, w = (n // step_px * step_px for n in corners.shape)
    squares = strength[:h, :w].reshape(h // step_px, step_px, w // step_px, step_px)
    cells = squares.transpose(0, 2, 1, 3).reshape(h // step_px, w // step_px, -1)
    best, where = cells.max(axis=2), cells.argmax(axis=2)
    used = best > 0
    if not used.any():
        return np.zeros((0, 2), np.intp)
    row, column = np.nonzero(best > 0.5 * np.median(best[used]))
    inner_y, inner_x = np.divmod(where[row, column], step_px)
    return np.stack([column * step_px + inner_x, row * step_px + inner_y], axis=1)
