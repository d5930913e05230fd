"""How bright each photo is against the others, from the surface that they share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from texproj.color.points import Floats
from texproj.color.survey import Survey

DARKEST, BRIGHTEST = 0.003, 0.92
"""Linear values between which a photo's response is trusted: above the noise and the rounding of
8 bits, below clipping."""

SURE_WEIGHT = 0.02
"""Samples with less weight (borders, silhouettes, glancing views) tell nothing of the exposure."""

PRIOR = 1e-4
"""Weight of the prior (log gain 0) against one overlapping point: enough for photos that share
nothing with others, nothing against a real overlap."""

ROUNDS = 12

Doubles = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gains:
    """Factors on linear light that make the photos agree.

    factor: (p, 3) float32 per photo and channel, geometric mean 1 over the photos that overlap;
    spread: (p,) median absolute log difference to the others after correction; points: (p,)
    points that the photo shares with another one.
    """

    factor: Floats
    spread: Floats
    points: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Overlaps:
    """m trusted observations of points that at least two photos see.

    photo, point: (m,) int32, points numbered 0..n; log_rgb: (m, 3); photos, points: how many.
    """

    photo: NDArray[np.int32]
    point: NDArray[np.int32]
    log_rgb: Doubles
    photos: int
    points: int

    def per_photo(self, values: Doubles) -> Doubles:
        """(p,) sums of (m,) values."""
        return np.bincount(self.photo, values, self.photos).astype(np.float64, copy=False)

    def per_point(self, values: Doubles) -> Doubles:
        """(n,) sums of (m,) values."""
        return np.bincount(self.point, values, self.points).astype(np.float64, copy=False)

    def centers(self, values: Doubles, weight: Doubles) -> Doubles:
        """(m, k) weighted mean of (m, k) values over the photos, at each observation's point."""
        norm = np.maximum(self.per_point(weight), 1e-12)
        means = [self.per_point(weight * column) / norm for column in values.T]
        return np.stack(means, axis=1)[self.point]


def no_gains(photos: int) -> Gains:
    """Every photo as it is."""
    return Gains(
        np.ones((photos, 3), np.float32), np.zeros(photos, np.float32), np.zeros(photos, np.int64)
    )


def solve_gains(survey: Survey) -> Gains:
    """Per-photo, per-channel gains by robust least squares on log colors of shared points.

    Unknown are the log gain of each photo and the log color of each point; the points are
    eliminated, so that a (p, p) system is left. Cauchy weights, scale from the median residual,
    reset in each of `ROUNDS` rounds. Gauge: mean log gain 0 (by `PRIOR`).
    """
    shared = overlaps(survey)
    log_gain, residual = np.zeros((shared.photos, 3)), np.zeros(len(shared.photo))
    weight = np.ones(len(shared.photo))
    for _ in range(ROUNDS if len(weight) else 0):
        log_gain = _solve(shared, weight)
        corrected = shared.log_rgb + log_gain[shared.photo]
        residual = np.abs(corrected - shared.centers(corrected, weight)).mean(axis=1)
        scale = max(2.0 * float(np.median(residual)), 1e-3)
        weight = 1 / (1 + (residual / scale) ** 2)
    points = np.bincount(shared.photo, minlength=shared.photos)
    if points.any():
        log_gain -= log_gain[points > 0].mean(axis=0)
    spread = [np.median(residual[shared.photo == p]) if n else 0.0 for p, n in enumerate(points)]
    return Gains(np.exp(log_gain).astype(np.float32), np.array(spread, np.float32), points)


def overlaps(survey: Survey) -> Overlaps:
    """What in a survey can be compared."""
    rgb = survey.rgb
    sound = (rgb.min(axis=1) > DARKEST) & (rgb.max(axis=1) < BRIGHTEST)
    sound &= survey.weight > SURE_WEIGHT
    seen_by = np.bincount(survey.point[sound], minlength=survey.points)
    sound &= seen_by[survey.point] > 1
    number = np.cumsum(seen_by > 1, dtype=np.int32) - 1
    return Overlaps(
        survey.photo[sound],
        number[survey.point[sound]],
        np.log(rgb[sound].astype(np.float64)),
        len(survey.shots),
        int(np.count_nonzero(seen_by > 1)),
    )


def _solve(shared: Overlaps, weight: Doubles) -> Doubles:
    """(p, 3) log gains of the weighted least squares problem, points eliminated."""
    center = shared.centers(shared.log_rgb, weight)
    per_point = np.maximum(shared.per_point(weight), 1e-12)
    shape = (shared.photos, shared.points)
    seen = csr_array((weight, (shared.photo, shared.point)), shape=shape)
    share = csr_array((weight / per_point[shared.point], (shared.photo, shared.point)), shape=shape)
    normal = np.diag(shared.per_photo(weight)) - (share @ seen.T).toarray()
    normal += PRIOR * np.eye(shared.photos)
    difference = weight[:, None] * (center - shared.log_rgb)
    right = np.stack([shared.per_photo(column) for column in difference.T], axis=1)
    return np.linalg.solve(normal, right).astype(np.float64, copy=False)
