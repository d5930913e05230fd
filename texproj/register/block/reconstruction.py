"""What structure from motion makes of photos alone: cameras and points in a frame of their own."""

from __future__ import annotations

from dataclasses import dataclass

from texproj.arrays import Doubles, Floats, Index
from texproj.camera import Camera


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Photos that were placed with each other; position, turn and scale of the frame mean nothing.

    names: (p,) of the photos; cameras: (p,) full size, block frame; points: (n, 3) block frame;
    error_px: (n,) mean reprojection error, pixels of the reduced photos; angle_rad: (n,) largest
    angle between two of a point's rays; seen_by: for each point the (k,) numbers of the photos that
    saw it; seen_at: for each point the (k, 2) full-size pixels where they did.
    """

    names: tuple[str, ...]
    cameras: tuple[Camera, ...]
    points: Doubles
    error_px: Doubles
    angle_rad: Doubles
    seen_by: tuple[Index, ...]
    seen_at: tuple[Floats, ...]
