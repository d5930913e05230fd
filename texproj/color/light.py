"""How much light each photo and each lens gathers against the others, from the surface that they
share and from what their headers say: robust least squares on logarithms of linear light.

After Goldman and Chen, "Vignette and exposure calibration and compensation", ICCV 2005; priors,
weights and gauge are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.color.overlaps import Doubles, Overlaps

POWERS = 3
"""Unknowns of a lens: the logarithm of its light is linear in r^2, r^4, r^6."""

ROUNDS = 12

SYSTEMATIC = 0.03
"""Log gain that a usual photo's whole overlap may be wrong by, however many points it has: what
changes with the view, and what is not registered well, is common to many points."""

COMMON = 0.01
"""The same for one channel against the others."""

ANY_GAIN, ANY_TINT, ANY_FALLOFF = 1.5, 0.5, 0.5
"""Standard deviations, in log light, of gains, of channels against each other, and of a lens's
coefficients before anything is seen."""

EXIF_SIGMA = 0.15 * float(np.log(2))
"""Log gain by which honest EXIF exposures are off: rounded stops, shutters, transmission."""


@dataclass(frozen=True, eq=False)
class LightFit:
    """What the photos say about light.

    log_gain: (p, 3) that makes the photos agree; log_light: (L, POWERS) coefficients of the light
    of each lens, a polynomial in the squared radius without a constant; covariance: (p + POWERS L,
    same) of the mean log gains and then of the lenses; residual: (m,) mean absolute log difference
    of each observation to its point; exposure_off: (p,) log gain against what EXIF says, NaN where
    it says nothing.
    """

    log_gain: Doubles
    log_light: Doubles
    covariance: Doubles
    residual: Doubles
    exposure_off: Doubles


@dataclass(frozen=True, eq=False)
class _Equations:
    """Observed log light + log gain of the photo - log light of the lens = log light of the point.

    lens: (p,) the lens of each photo, -1 = one without falloff.
    """

    seen: Overlaps
    lens: NDArray[np.intp]
    lenses: int

    def powers(self) -> Doubles:
        """(m, POWERS) powers of the squared radius; 0 for lenses without falloff."""
        squared = self.seen.squared_radius * (self.lens[self.seen.photo] >= 0)
        return np.stack([squared ** (k + 1) for k in range(POWERS)], axis=1)

    def system(self, weight: Doubles) -> tuple[Doubles, Doubles]:
        """Normal matrix (K, K) and right side (K, 3), points eliminated; K = p + POWERS L."""
        seen, powers = self.seen, self.powers()
        dense = np.zeros((len(seen.start), seen.photos + POWERS * self.lenses))
        normal = np.zeros((dense.shape[1],) * 2)
        point, w = seen.point, weight[:, None]
        dense[point, seen.photo] = weight
        normal[: seen.photos, : seen.photos] = np.diag(seen.of_photos(w)[:, 0])
        norm = np.maximum(seen.of_points(weight), 1e-12)
        away = w * (seen.of_points(w * seen.log_rgb)[point] / norm[point, None] - seen.log_rgb)
        right = np.zeros((dense.shape[1], 3))
        right[: seen.photos] = seen.of_photos(away)
        for lens in range(self.lenses):
            at = slice(seen.photos + POWERS * lens, seen.photos + POWERS * (lens + 1))
            mine = -powers * (self.lens[seen.photo] == lens)[:, None]
            dense[:, at] = seen.of_points(w * mine)
            normal[: seen.photos, at] = seen.of_photos(w * mine)
            normal[at, : seen.photos] = normal[: seen.photos, at].T
            normal[at, at] = mine.T @ (w * mine)
            right[at] = mine.T @ away
        normal -= dense.T @ (dense / norm[:, None])
        return normal, right

    def corrected(self, log_gain: Doubles, log_light: Doubles) -> Doubles:
        """(m, 3) log colors with gains and lenses taken into account."""
        seen = self.seen
        out = seen.log_rgb + log_gain[seen.photo]
        if self.lenses:
            out -= (self.powers() * log_light[self.lens[seen.photo]]).sum(axis=1)[:, None]
        return out


@dataclass(frozen=True, eq=False)
class _Priors:
    """What is expected before any overlap is seen.

    log_exposure: (p,) log of the light gathered according to EXIF, NaN = unknown; doubt: (p,)
    standard deviation of it.
    """

    log_exposure: Doubles
    doubt: Doubles

    @property
    def information(self) -> Doubles:
        """(p,) 0 where EXIF says nothing."""
        return np.where(np.isfinite(self.log_exposure), self.doubt**-2, 0)

    def off(self, log_gain: Doubles) -> Doubles:
        """(p,) log gains against those that EXIF calls for, up to what all have in common."""
        off = log_gain + self.log_exposure
        total = max(float(self.information.sum()), 1e-12)
        return off - float(np.nansum(self.information * off)) / total

    def doubted(self, log_gain: Doubles, overlapping: NDArray[np.bool_]) -> _Priors:
        """As far as it is to be believed after these gains: Cauchy, scale from the median of the
        overlapping photos.
        """
        off = self.off(log_gain)
        judged = np.abs(off[overlapping & np.isfinite(off)])
        sigma = max(EXIF_SIGMA, 1.48 * float(np.median(judged)) if len(judged) else 0)
        doubt = sigma * np.sqrt(1 + (np.nan_to_num(off) / (2 * sigma)) ** 2)
        return _Priors(self.log_exposure, doubt)

    def system(self, unknowns: int) -> tuple[Doubles, Doubles]:
        """Normal matrix (K, K) and right side (K,) for the mean over the channels, what EXIF has
        in common eliminated.
        """
        p, information = len(self.doubt), self.information
        normal = np.diag(np.full(unknowns, ANY_FALLOFF**-2))
        share = information / max(float(information.sum()), 1e-12)
        exif = np.diag(information) - np.outer(information, share)
        normal[:p, :p] = exif + np.diag(np.full(p, ANY_GAIN**-2))
        right = np.zeros(unknowns)
        right[:p] = -exif @ np.nan_to_num(self.log_exposure)
        return normal, right


def solve_light(seen: Overlaps, lens: NDArray[np.intp], log_exposure: Doubles) -> LightFit:
    """Gains and lenses by reweighted least squares, Cauchy loss, scale from the median residual.

    lens: (p,) number of each photo's lens, -1 = keep it as it is; log_exposure: (p,) log of the
    light gathered according to EXIF, NaN = unknown.

    The log color of each point is eliminated. EXIF is believed as far as it goes along with the
    overlaps (Cauchy loss against its own median error), and decides where there are none. Gauge:
    mean log gain 0, each channel, over the photos of which anything is known; light 1 on the axis
    of the lens.
    """
    p, lenses = seen.photos, int(lens.max(initial=-1)) + 1
    equations = _Equations(seen, lens, lenses)
    priors = _Priors(log_exposure, np.full(p, EXIF_SIGMA))
    weight, residual, noise = np.ones(len(seen.photo)), np.zeros(len(seen.photo)), 0.0
    for _ in range(ROUNDS):
        solution, covariance = _solved(equations, weight, noise, priors)
        log_gain, log_light = solution[:p], solution[p:, 0].reshape(lenses, POWERS)
        priors = priors.doubted(log_gain.mean(axis=1), seen.count > 0)
        if len(weight):
            residual = _residual(seen, equations.corrected(log_gain, log_light), weight)
            noise = float(np.median(residual))
            weight = 1 / (1 + (residual / max(2 * noise, 1e-3)) ** 2)
    off = priors.off(log_gain.mean(axis=1))
    known = (seen.count > 0) | np.isfinite(log_exposure)
    log_gain = log_gain - (log_gain[known].mean(axis=0) if known.any() else 0)
    return LightFit(log_gain, log_light, covariance, residual, off)


def _solved(
    equations: _Equations, weight: Doubles, noise: float, priors: _Priors
) -> tuple[Doubles, Doubles]:
    """(K, 3) unknowns, the lenses' equal in all channels, and (K, K) covariance of their mean."""
    p = equations.seen.photos
    normal, right = equations.system(weight)
    expected, toward = priors.system(len(normal))
    points = equations.seen.of_photos(weight[:, None])[:, 0]
    usual = float(np.median(points[points > 0])) if len(weight) else 1.0
    one = 1 / max(usual * SYSTEMATIC**2, (1.48 * noise) ** 2)
    covariance: Doubles = np.linalg.inv(one * normal + expected).astype(np.float64)
    mean = covariance @ (one * right.mean(axis=1) + toward)
    one = 1 / max(usual * COMMON**2, (1.48 * noise) ** 2)
    tint = np.zeros((len(normal), 3))
    tinted = right[:p] - right[:p].mean(axis=1, keepdims=True)
    tint[:p] = np.linalg.solve(one * normal[:p, :p] + ANY_TINT**-2 * np.eye(p), one * tinted)
    return mean[:, None] + tint, covariance


def _residual(seen: Overlaps, corrected: Doubles, weight: Doubles) -> Doubles:
    """(m,) mean absolute difference to the weighted mean of the point."""
    norm = np.maximum(seen.of_points(weight), 1e-12)[:, None]
    center = seen.of_points(weight[:, None] * corrected) / norm
    away: Doubles = np.abs(corrected - center[seen.point]).mean(axis=1)
    return away
