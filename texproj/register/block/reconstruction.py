"""What structure from motion makes of photos alone: their cameras and points, in one frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from texproj.arrays import Doubles, Floats, Index
from texproj.camera import Camera


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Photos whose places relative to each other are known: a block. Its frame is its own: where
    its origin is, how it is turned and how long its unit is mean nothing.

    names: (p,) of the photos, in the order in which they were given; cameras: (p,) for the upright
    full-size photos, world = the block's frame; lenses: (p,) the same word for photos of one lens.
    points: (n, 3) block frame; error_px: (n,) mean reprojection error, pixels of the reduced
    photos; angle_rad: (n,) largest angle between two rays. The sightings of point k are rows
    ``track_starts[k]:track_starts[k + 1]`` of `observer` (m,), which are rows of `names`, and of
    `xy_px` (m, 2), full-size pixels.
    """

    names: tuple[str, ...]
    cameras: tuple[Camera, ...]
    lenses: tuple[str, ...]
    points: Doubles
    error_px: Doubles
    angle_rad: Doubles
    track_starts: Index
    observer: Index
    xy_px: Floats

    @cached_property
    def seen_by(self) -> tuple[Index, ...]:
        """(n,) for each point the rows in `names` of the photos that saw it."""
        return tuple(np.split(self.observer, self.track_starts[1:-1]))

    @cached_property
    def point_of_sighting(self) -> Index:
        """(m,) row in `points` of each sighting."""
        return np.repeat(np.arange(len(self.points)), np.diff(self.track_starts))

    def seen_from(self, photo: int) -> tuple[Index, Floats]:
        """The (k,) points that a photo saw, by the photo's row, and the (k, 2) pixels where."""
        own = self.observer == photo
        return self.point_of_sighting[own], self.xy_px[own]
