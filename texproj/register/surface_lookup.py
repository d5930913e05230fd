"""Which points of the mesh a registered photo shows at its pixels."""

from __future__ import annotations

import cv2
import numpy as np

from texproj.arrays import Doubles, Floats, Index
from texproj.camera import Camera

STEEPEST_JUMP = 0.02
"""Surface whose depth varies by more than this part around a pixel gives no sure point."""


def surface_at(camera: Camera, depth: Floats, xy_px: Doubles) -> tuple[Index, Doubles]:
    """Rows of the pixels (n, 2) that lie on smooth surface, and the (k, 3) world points there.

    camera: full size, as are the pixels; depth: (h, w) along the axis as the camera sees the mesh
    at a reduced size, inf where it does not.
    """
    kernel = np.ones((5, 5), np.uint8)
    near, far = cv2.erode(depth, kernel), cv2.dilate(depth, kernel)
    h, w = depth.shape
    column, row = (xy_px * (w / camera.width)).astype(int).T
    column, row = column.clip(0, w - 1), row.clip(0, h - 1)
    with np.errstate(invalid="ignore"):
        smooth = far[row, column] - near[row, column] < STEEPEST_JUMP * near[row, column]
    use = np.flatnonzero(smooth & np.isfinite(far[row, column]))
    return use, camera.unproject(xy_px[use], depth[row[use], column[use]])
