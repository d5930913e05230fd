"""The light of the day from colors of the surface: sky in spherical harmonics, sun, palette.

Ours, after Ramamoorthi and Hanrahan 2001 (irradiance in spherical harmonics) and precomputed
radiance transfer (Sloan, Kautz, Snyder, SIGGRAPH 2002): an albedo of few values times a light of
few numbers is fitted by alternation, robustly. The color c of a matte point of albedo a is
``c = a / pi (T L + s sun + E)`` with its transfer T, its cosine to the sun, and the irradiance E
from the surface around it, which needs no unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.palette import (
    DARKEST,
    clusters,
    log_chroma,
    medians,
    members,
    moved,
)
from texproj.appearance.transfer import Transfer
from texproj.arrays import Doubles, Index
from texproj.photo import LUMINANCE

ROUNDS = 12
MOVES = 2
"""Rounds of k-means in each round: clusters follow the light."""

QUICK_ROUNDS = 3
LOSS_SCALE = 0.15
"""Relative difference at which a point counts half (Cauchy): textures vary by that."""

RIDGE = 1e-4
"""Pull of the harmonics above the constant one to 0, as a part of the points: what points in few
directions do not tell stays small."""

NO_LIGHT = 1e-9
"""The same for all: where no point sees any of a light, as in a closed room, there is none."""

MEAN_ALBEDO = 0.35
"""What the mean of the surface is taken for where nothing tells: stone, wood, skin, soil."""

GLOSS = 0.025
"""Mean reflection that is no paint's: a dielectric's .04 (an index of 1.5) of what is mirrored, and
from above, where photos are taken, that is the ground oftener than the sky. .02 to .03 fit best on
three pieces in sun and clouds, from the darkest paint on.
"""

LEAST_LIGHT = 0.03
"""Least irradiance, as a part of the usual one: no point is in perfect darkness."""


@dataclass(frozen=True, eq=False)
class LitPoints:
    """n points: rgb (n, 3) blended linear light; transfer: of the same; sun: (n,) cosine to the
    sun, 0 in its shadow, or None.
    """

    rgb: Doubles
    transfer: Transfer
    sun: Doubles | None = None

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> LitPoints:
        """Some of them."""
        t = self.transfer
        sun = None if self.sun is None else self.sun[rows]
        return LitPoints(
            self.rgb[rows], Transfer(t.sky[rows], t.indirect[rows], t.openness[rows]), sun
        )

    @property
    def columns(self) -> Doubles:
        """(n, 9 or 10) irradiance by each unknown of the light."""
        sky = self.transfer.sky.astype(np.float64)
        return sky if self.sun is None else np.column_stack([sky, self.sun])


@dataclass(frozen=True, eq=False)
class LightFit:
    """A light and the palette that goes with it.

    sky: (9, 3) radiance of the sky by spherical harmonics; sun: (3,) irradiance square to the sun,
    or None; centers: (k, 2) log chroma and albedo: (k, 3) of the paints, gloss included; spread:
    mean of |log of color over model|, cut at 1, of the points that were fitted.
    """

    sky: Doubles
    sun: Doubles | None
    centers: Doubles
    albedo: Doubles
    spread: float

    def irradiance(self, points: LitPoints) -> Doubles:
        """(n, 3) at points, never below `LEAST_LIGHT` of the usual."""
        light = self.sky if self.sun is None else np.vstack([self.sky, self.sun])
        return _bounded(points.columns @ light + points.transfer.indirect)

    def labels(self, points: LitPoints) -> Index:
        """(n,) the paint of each point, by its chroma alone."""
        return members(log_chroma(points.rgb / self.irradiance(points)), self.centers)

    def predicted(self, points: LitPoints) -> Doubles:
        """(n, 3) colors of points by their chroma alone: the paint's albedo under the light."""
        return self.albedo[self.labels(points)] * self.irradiance(points) / np.pi


def fit_light(points: LitPoints, start: LightFit | None = None, rounds: int = ROUNDS) -> LightFit:
    """The light under which the points' palette is tightest.

    start: a light to begin with, with or without a sun; else the same light from everywhere.
    """
    columns, indirect = points.columns, points.transfer.indirect.astype(np.float64)
    light, centers = _start(points, start), None
    irradiance = _bounded(columns @ light + indirect)
    for _ in range(rounds):
        albedo = _gauged(np.pi * points.rgb / irradiance, irradiance)
        chroma = log_chroma(albedo)
        centers = clusters(chroma) if centers is None else moved(chroma, centers, MOVES)
        label = members(chroma, centers)
        palette = medians(albedo, label, len(centers))
        light = _solved(points.rgb, columns, indirect, palette[label], irradiance)
        irradiance = _bounded(columns @ light + indirect)
    assert centers is not None
    fit = LightFit(light[:9], light[9] if len(light) > 9 else None, centers, palette, 0.0)
    return replace(fit, spread=spread(points, fit.predicted(points)))


class SunTrial:
    """Suns compared by how tight the palette of luminances is with them, the paint of each point
    held: a hundredth of the time of a fit.
    """

    def __init__(self, points: LitPoints, without: LightFit) -> None:
        """without: the light found without a sun, by which the points have their paint."""
        self._label = without.labels(points)
        self._count = np.maximum(np.bincount(self._label), 1)
        self._seen = np.maximum(points.rgb @ LUMINANCE, DARKEST)
        self._sky = points.transfer.sky.astype(np.float64)
        self._indirect = points.transfer.indirect.astype(np.float64) @ LUMINANCE
        light = without.irradiance(replace(points, sun=None))
        self._light = light @ LUMINANCE

    def spread(self, sun: Doubles) -> float:
        """As that of a `LightFit`, with the points' (n,) cosine to a sun; inf where it shines on
        none.
        """
        if not sun.any():
            return np.inf
        columns, light = np.column_stack([self._sky, sun]), self._light
        for _ in range(QUICK_ROUNDS):
            wanted = np.pi * self._seen / self._paint(light)
            found = _ridge(columns, wanted, self._indirect, light)
            found[9] = max(found[9], 0)
            light = _bounded(columns @ found + self._indirect)
        off = np.abs(np.log(np.pi * self._seen / self._paint(light) / light))
        return float(np.minimum(off, 1).mean())

    def _paint(self, light: Doubles) -> Doubles:
        """(n,) albedo of each point's paint: the geometric mean of its points."""
        log = np.log(np.pi * self._seen / light)
        log -= np.log(light).mean() - np.log(self._light).mean()
        return np.exp(np.bincount(self._label, log) / self._count)[self._label]


def spread(points: LitPoints, predicted: Doubles) -> float:
    """Mean of |log luminance of the points over that predicted|, cut at 1."""
    seen, told = points.rgb @ LUMINANCE, predicted @ LUMINANCE
    off = np.abs(np.log(np.maximum(seen, 1e-4) / np.maximum(told, 1e-4)))
    return float(np.minimum(off, 1).mean())


def _start(points: LitPoints, start: LightFit | None) -> Doubles:
    """(9 or 10, 3) a light to begin with."""
    light = np.zeros((points.columns.shape[1], 3))
    if start is None:
        light[0] = 2.0 * points.rgb.mean(axis=0) / 0.28
        return light
    light[:9] = start.sky
    if len(light) > 9 and start.sun is not None:
        light[9] = start.sun
    return light


def _bounded(irradiance: Doubles) -> Doubles:
    return np.maximum(irradiance, LEAST_LIGHT * np.maximum(irradiance.mean(axis=0), 1e-6))


def _gauged(albedo: Doubles, irradiance: Doubles) -> Doubles:
    """The albedo of a light whose tint, in the geometric mean over the points, is neutral, and
    whose median is `MEAN_ALBEDO`: what colors alone cannot tell.
    """
    albedo = albedo * np.exp(np.log(irradiance).mean(axis=0))
    level = np.median(albedo @ LUMINANCE)
    return albedo * ((MEAN_ALBEDO + GLOSS) / max(float(level), 1e-6))


def _solved(
    rgb: Doubles, columns: Doubles, indirect: Doubles, albedo: Doubles, before: Doubles
) -> Doubles:
    """(9 or 10, 3) light by weighted ridge least squares of relative differences."""
    wanted = np.pi * rgb / np.maximum(albedo, 1e-3)
    channels = [_ridge(columns, wanted[:, k], indirect[:, k], before[:, k]) for k in range(3)]
    out = np.stack(channels, axis=1)
    if len(out) > 9:
        out[9] = np.maximum(out[9], 0)
    return out


def _ridge(columns: Doubles, wanted: Doubles, indirect: Doubles, before: Doubles) -> Doubles:
    """(9 or 10,) light that gives the points their wanted irradiance, but what is `indirect`;
    before: (n,) irradiance so far, by which differences are taken and outliers known.
    """
    off = np.log(np.maximum(wanted, 1e-4) / before)
    weight = 1 / (1 + (off / LOSS_SCALE) ** 2) * (before.mean() / before) ** 2
    left = columns * weight[:, None]
    pull = np.full(columns.shape[1], NO_LIGHT * len(wanted))
    pull[1:9] = RIDGE * len(wanted) * (np.pi * 0.28) ** 2
    return np.linalg.solve(columns.T @ left + np.diag(pull), left.T @ (wanted - indirect))
