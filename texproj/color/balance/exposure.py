"""How much light each photo and each lens gathers against the others, from the surface that they
share and from what their headers say: robust least squares on logarithms of linear light.

After Goldman and Chen, "Vignette and exposure calibration and compensation", ICCV 2005; priors,
weights and gauge are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.color.balance.overlaps import Overlaps

POWERS = 3
"""Unknowns of a lens: the logarithm of its light is linear in r^2, r^4, r^6."""

ROUNDS, SETTLED = 12, 3e-4
"""Most rounds of reweighting, and the change of log light after which there are no more."""

DENSE = 1 << 20
"""Values of a dense matrix that are made at once."""

PARTS = 8
"""Groups of photos, and parts of the surface, that are left out in turn to see what changes."""

SYSTEMATIC = 0.03
"""Log gain that a usual photo's whole overlap may be wrong by, however many points it has: what
changes with the view, and what is not registered well, is common to many points."""

COMMON = 0.01
"""The same for one channel against the others."""

ANY_GAIN, ANY_TINT, ANY_FALLOFF = 1.0, 0.5, 6.0
"""Standard deviations, in log light, of gains, of channels against each other, and of a lens's
coefficients before anything is seen."""

EXIF_SIGMA = 0.15 * float(np.log(2))
"""Log gain by which honest EXIF exposures are off: rounded stops, shutters, transmission."""


@dataclass(frozen=True, eq=False)
class LightFit:
    """What the photos say about light.

    log_gain: (p, 3) that makes the photos agree; log_light: (L, POWERS) coefficients of the light
    of each lens, a polynomial in the squared radius without a constant; scatter: (L, POWERS,
    POWERS) covariance of these; residual: (m,) mean absolute log difference of each observation
    to its point; exposure_off: (p,) log gain against what EXIF says, NaN where it says nothing.
    """

    log_gain: Doubles
    log_light: Doubles
    scatter: Doubles
    residual: Doubles
    exposure_off: Doubles


@dataclass(frozen=True, eq=False)
class _Equations:
    """Observed log light + log gain of the photo - log light of the lens = log light of the point.

    lens: (p,) the lens of each photo, -1 = one without falloff.
    """

    seen: Overlaps
    lens: NDArray[np.intp]

    @cached_property
    def point(self) -> NDArray[np.intp]:
        """(m,) the point that is seen."""
        return self.seen.point

    @cached_property
    def columns(self) -> Doubles:
        """(m, POWERS L) derivative of the left side by the coefficients of the lenses."""
        squared, lens = self.seen.squared_radius, self.lens[self.seen.photo]
        powers = squared[:, None] ** np.arange(1, POWERS + 1)
        return np.concatenate(
            [np.zeros((len(powers), 0)), *(-powers * (lens == n)[:, None] for n in self.numbers)],
            axis=1,
        )

    @cached_property
    def numbers(self) -> range:
        """The lenses."""
        return range(int(self.lens.max(initial=-1)) + 1)

    def system(self, weight: Doubles) -> tuple[Doubles, Doubles]:
        """Normal matrix (K, K) and right side (K, 3), points eliminated; K = p + POWERS L."""
        seen, point, p, w = self.seen, self.point, self.seen.photos, weight[:, None]
        norm = np.maximum(seen.of_points(weight), 1e-12)[:, None]
        away = w * ((seen.of_points(w * seen.log_rgb) / norm)[point] - seen.log_rgb)
        bent = w * self.columns
        normal = -self.eliminated(weight, seen.of_points(bent), norm)
        normal[range(p), range(p)] += seen.of_photos(w)[:, 0]
        both = seen.of_photos(bent)
        normal[:p, p:] += both
        normal[p:, :p] += both.T
        normal[p:, p:] += self.columns.T @ bent
        return normal, np.concatenate([seen.of_photos(away), self.columns.T @ away])

    def eliminated(self, weight: Doubles, bent: Doubles, norm: Doubles) -> Doubles:
        """(K, K) what the unknown colors of the points take from the normal matrix.

        bent: (n, POWERS L) weighted sums of `columns`, norm: (n, 1) of the weights, at the points.
        """
        seen, p = self.seen, self.seen.photos
        out = np.zeros((p + bent.shape[1],) * 2)
        step = max(1, DENSE // len(out))
        for first in range(0, len(norm), step):
            part = slice(first, first + step)
            here = slice(*np.searchsorted(self.point, (first, first + step)))
            together = np.zeros((len(norm[part]), len(out)))
            together[self.point[here] - first, seen.photo[here]] = weight[here]
            together[:, p:] = bent[part]
            out += together.T @ (together / norm[part])
        return out

    def corrected(self, log_gain: Doubles, log_light: Doubles) -> Doubles:
        """(m, 3) log colors with gains and lenses taken into account."""
        falloff = self.columns @ log_light.ravel()
        return self.seen.log_rgb + log_gain[self.seen.photo] + falloff[:, None]

    def level(self, log_gain: Doubles, log_light: Doubles, known: NDArray[np.bool_]) -> Doubles:
        """(3,) mean log correction, over the photos that overlap or are `known`, of what they
        show of the surface.
        """
        count = self.seen.count
        falloff = self.seen.of_photos((self.columns @ log_light.ravel())[:, None])
        level = log_gain + falloff / np.maximum(count, 1)[:, None]
        used = known | (count > 0)
        return level[used].mean(axis=0) if used.any() else np.zeros(3)

    def residual(self, log_gain: Doubles, log_light: Doubles, weight: Doubles) -> Doubles:
        """(m,) mean absolute difference to the weighted mean of the point."""
        corrected, seen = self.corrected(log_gain, log_light), self.seen
        norm = np.maximum(seen.of_points(weight), 1e-12)[:, None]
        center = seen.of_points(weight[:, None] * corrected) / norm
        away: Doubles = np.abs(corrected - center[self.point]).mean(axis=1)
        return away


@dataclass(frozen=True, eq=False)
class _Priors:
    """What is expected before any overlap is seen.

    log_exposure: (p,) log of the light gathered according to EXIF, NaN = unknown; sigma: (p,)
    standard deviation of it.
    """

    log_exposure: Doubles
    sigma: Doubles

    @property
    def information(self) -> Doubles:
        """(p,) 0 where EXIF says nothing."""
        return np.where(np.isfinite(self.log_exposure), self.sigma**-2, 0)

    def off(self, log_gain: Doubles) -> Doubles:
        """(p,) log gains against those that EXIF calls for, up to what all have in common."""
        off = log_gain + self.log_exposure
        total = max(float(self.information.sum()), 1e-12)
        return off - float(np.nansum(self.information * off)) / total

    def weighed(self, log_gain: Doubles, overlapping: NDArray[np.bool_]) -> _Priors:
        """What is expected after these gains, wider where EXIF has proved wrong: Cauchy, scale from
        the median of the overlapping photos.
        """
        off = self.off(log_gain)
        judged = np.abs(off[overlapping & np.isfinite(off)])
        scale = max(EXIF_SIGMA, 1.48 * float(np.median(judged)) if len(judged) else 0)
        sigma = scale * np.sqrt(1 + (np.nan_to_num(off) / (2 * scale)) ** 2)
        return _Priors(self.log_exposure, sigma)

    def system(self, unknowns: int) -> tuple[Doubles, Doubles]:
        """Normal matrix (K, K) and right side (K,) for the mean over the channels, what EXIF has
        in common eliminated.
        """
        p, information = len(self.sigma), self.information
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
    the light of a lens is 1 on its axis, and the corrections of what the photos show, gains and
    lenses together, are 1 in the geometric mean of all photos, each channel: the colors are as
    bright as the photos are on the average.
    """
    equations, p = _Equations(seen, lens), seen.photos
    priors = _Priors(log_exposure, np.full(p, EXIF_SIGMA))
    weight, residual, noise = np.ones(len(seen.photo)), np.zeros(len(seen.photo)), 0.0
    solution = np.full((p, 3), np.inf)
    for _ in range(ROUNDS):
        before, solution = solution, _solved(equations, weight, noise, priors)
        log_gain, log_light = solution[:p], solution[p:, 0].reshape(-1, POWERS)
        priors = priors.weighed(log_gain.mean(axis=1), seen.count > 0)
        if len(weight):
            residual = equations.residual(log_gain, log_light, weight)
            noise = float(np.median(residual))
            weight = 1 / (1 + (residual / max(2 * noise, 1e-3)) ** 2)
        if np.abs(solution[:p] - before[:p]).max(initial=0) < SETTLED:
            break
    scatter = _scatter(equations, weight, noise, priors)
    off = priors.off(log_gain.mean(axis=1))
    log_gain = log_gain - equations.level(log_gain, log_light, np.isfinite(log_exposure))
    return LightFit(log_gain, log_light, scatter, residual, off)


def _solved(equations: _Equations, weight: Doubles, noise: float, priors: _Priors) -> Doubles:
    """(K, 3) unknowns, the lenses' equal in all channels."""
    p = equations.seen.photos
    normal, right = equations.system(weight)
    expected, toward = priors.system(len(normal))
    points = np.diag(normal)[:p]
    usual = float(np.median(points[points > 0])) if (points > 0).any() else 1.0
    one = 1 / max(usual * SYSTEMATIC**2, (1.48 * noise) ** 2)
    out = np.zeros((len(normal), 3))
    out += np.linalg.solve(one * normal + expected, one * right.mean(axis=1) + toward)[:, None]
    one = 1 / max(usual * COMMON**2, (1.48 * noise) ** 2)
    tinted = one * (right[:p] - right[:p].mean(axis=1, keepdims=True))
    out[:p] += np.linalg.solve(one * normal[:p, :p] + ANY_TINT**-2 * np.eye(p), tinted)
    return out


def _scatter(equations: _Equations, weight: Doubles, noise: float, priors: _Priors) -> Doubles:
    """(L, POWERS, POWERS) covariance of the lenses' coefficients by the jackknife (Efron and
    Tibshirani 1993, chapter 11): what leaving out photos changes, plus what leaving out parts of
    the surface changes. Residuals are far from independent, so that their scatter says little.
    """
    seen, lenses = equations.seen, len(equations.numbers)
    total = np.zeros((lenses, POWERS, POWERS))
    if not lenses:
        return total
    for group in (seen.photo % PARTS, equations.point * PARTS // len(seen.start)):
        parts = [
            _solved(equations, weight * (group != part), noise, priors)[seen.photos :, 0]
            for part in range(min(PARTS, int(group.max()) + 1))
        ]
        away = np.reshape(parts, (-1, lenses, POWERS))
        away = away - away.mean(axis=0)
        total += np.einsum("glk,glm->lkm", away, away) * (len(parts) - 1) / len(parts)
    return total
