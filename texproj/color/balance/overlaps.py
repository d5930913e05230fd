"""Points that several photos show well: what the corrections of light are solved from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.color.balance.shared_points import SharedPoints

DARKEST, BRIGHTEST = 0.003, 0.92
"""Linear values between which a photo's response is trusted: above the noise and the rounding of
8 bits, below clipping."""

SURE_WEIGHT = 0.02
"""Samples with less weight (borders, silhouettes, glancing views) tell nothing of the exposure."""

ENOUGH, ENOUGH_EACH = 20_000, 300
"""Observations, in all and per photo, from which on more points would not make the corrections any
surer: what is left is not noise, but what is common to many points."""


@dataclass(frozen=True, eq=False)
class Overlaps:
    """m observations of n points, point by point; each point is seen by two photos or more.

    photos: how many there are in all; photo: (m,) int32; start: (n,) the first observation of each
    point; log_rgb: (m, 3); squared_radius: (m,) distance from the principal point over half the
    picture's diagonal, squared.
    """

    photos: int
    photo: NDArray[np.int32]
    start: NDArray[np.intp]
    log_rgb: Doubles
    squared_radius: Doubles

    @property
    def point(self) -> NDArray[np.intp]:
        """(m,) the point that is seen."""
        return np.repeat(np.arange(len(self.start)), np.diff(self.start, append=len(self.photo)))

    @property
    def count(self) -> NDArray[np.int64]:
        """(p,) observations of each photo."""
        return np.bincount(self.photo, minlength=self.photos).astype(np.int64)

    def of_photos(self, values: Doubles) -> Doubles:
        """(p, k) sums of (m, k) values."""
        out = np.zeros((self.photos, values.shape[1]))
        for column, sums in zip(values.T, out.T, strict=True):
            sums[:] = np.bincount(self.photo, column, self.photos)
        return out

    def of_points(self, values: Doubles) -> Doubles:
        """(n, ...) sums of (m, ...) values."""
        return np.add.reduceat(values, self.start, axis=0) if len(values) else values


def overlaps(shared: SharedPoints) -> Overlaps:
    """What of the shared points can be compared."""
    rgb = shared.rgb
    sound = (rgb.min(axis=1) > DARKEST) & (rgb.max(axis=1) < BRIGHTEST)
    sound &= shared.weight > SURE_WEIGHT
    seen_by = np.bincount(shared.point[sound], minlength=shared.points)
    kept = np.flatnonzero(sound & (seen_by[shared.point] > 1))
    step = -(-len(kept) // max(ENOUGH, ENOUGH_EACH * len(shared.shots)))
    kept = kept[_number_of(seen_by > 1)[shared.point[kept]] % max(step, 1) == 0]
    kept = kept[np.argsort(shared.point[kept], kind="stable")]
    point = shared.point[kept]
    start = np.flatnonzero(np.diff(point, prepend=-1))
    log_rgb = np.log(rgb[kept].astype(np.float64))
    return Overlaps(
        len(shared.shots), shared.photo[kept], start, log_rgb, _squared_radius(shared, kept)
    )


def _number_of(chosen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The rank of each chosen item among those that are chosen."""
    return np.cumsum(chosen) - 1


def _squared_radius(shared: SharedPoints, rows: NDArray[np.intp]) -> Doubles:
    """(k,) of some observations, see `Overlaps`."""
    lenses = np.ones((len(shared.shots), 3))
    for number, shot in enumerate(shared.shots):
        if shot is not None:
            k = shot.camera.intrinsics
            lenses[number] = k.cx, k.cy, np.hypot(k.width, k.height) / 2
    cx, cy, half = lenses[shared.photo[rows]].T
    x, y = shared.xy_px[rows].T
    return ((x - cx) ** 2 + (y - cy) ** 2) / half**2
