"""Distance between two cameras, by what they show of the surface."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera


def motion_px(camera: Camera, other: Camera, xyz_in_world: Doubles) -> float:
    """Mean distance between the two cameras' images of the points (n, 3), pixels; inf if no point
    has an image in both.
    """
    gap = np.linalg.norm(camera.project(xyz_in_world)[0] - other.project(xyz_in_world)[0], axis=1)
    gap = gap[np.isfinite(gap)]
    return float(gap.mean()) if len(gap) else float("inf")
