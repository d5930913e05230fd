"""Positions as OpenCV counts them: from the center of an image's first pixel, not its corner."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats

FAR_OUTSIDE = -1e6
"""Stands for a position that does not exist: outside of any image, and exact in float32."""


def opencv_places(xy_px: NDArray[Any]) -> Floats:
    """(..., 2) float32 positions for `cv2.remap` of pixels (..., 2); `FAR_OUTSIDE` for NaN."""
    return np.nan_to_num(xy_px - 0.5, nan=FAR_OUTSIDE).astype(np.float32)
