"""Where a photo shows anything that could be found again."""

from __future__ import annotations

import cv2
import numpy as np

from texproj.arrays import Floats, Mask
from texproj.solve.orientation import DARK

BLUR_PX = 1.5
LEAST_SLOPE = 0.01
"""Change of the logarithm of luma per pixel, after the blur: five times what the noise of a photo
of 8 bits leaves there, a tenth of a soft shadow's edge."""
REACH_PX = 7
"""How far from an edge a patch still holds it."""


def textured(gray: Floats) -> Mask:
    """(h, w) where something more than noise is near: luma in 0..1."""
    smooth = cv2.GaussianBlur(np.log(gray + np.float32(DARK)), (0, 0), BLUR_PX)
    dx = cv2.Scharr(smooth, cv2.CV_32F, 1, 0, scale=1 / 32)
    dy = cv2.Scharr(smooth, cv2.CV_32F, 0, 1, scale=1 / 32)
    steep = (cv2.magnitude(dx, dy) > LEAST_SLOPE).astype(np.uint8)
    return cv2.dilate(steep, np.ones((2 * REACH_PX + 1,) * 2, np.uint8)) > 0
