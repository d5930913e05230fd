"""The light of a room, from what photos show of points of an object that was turned in it.

Ours. The color of a matte point of albedo a in photo p is ``c = a / pi (T M_p L + s lamp_p + E_p)``
with its transfer T, the turn M_p of the room's harmonics L, and the irradiance E_p from the surface
around. The log of that is fitted by Gauss and Newton. How one point differs between photos is light
alone; how points differ is paint too, which a palette tells roughly. Both count by what they are
worth: points have albedos of their own, at random around the palette's (a random-effects model; the
quasi-demeaning of Fuller and Battese, Journal of Econometrics 2, 1974).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.appearance.light_fit import GLOSS, LEAST_LIGHT, MEAN_ALBEDO, RIDGE
from texproj.appearance.palette import clusters, log_chroma, medians, members, moved
from texproj.appearance.sightings import Sightings, point_means
from texproj.arrays import Doubles, Index
from texproj.photo import LUMINANCE

ROUNDS = 12
MOVES = 2
"""Rounds of k-means in each round: clusters follow the light."""

WITHIN, BETWEEN = 0.08, 0.25
"""Standard deviations (log): of a point between photos about its own albedo, and of points of one
paint about the palette's. Their ratio says what differences between points are worth.
"""

OUTLIER = 0.1
"""Difference (log) at which a sighting counts half (Cauchy): highlights, edges of shadows."""

FARTHEST_PAINT = 0.6
"""Difference (log) of a point from its paint's usual albedo at which it is cut."""

DARKEST = 1e-3


@dataclass(frozen=True, eq=False)
class RoomFit:
    """light: (9 + k, 3) harmonics of the room's radiance, and irradiance of each lamp; centers,
    palette: the paints (`light_fit.LightFit`); spread: mean of |log of color over model|, cut at 1,
    points freed of their own albedo as far as many sightings tell it.
    """

    light: Doubles
    centers: Doubles
    palette: Doubles
    spread: float

    def irradiance(self, columns: Doubles, around: Doubles) -> Doubles:
        """(m, 3) of sightings."""
        return bounded(columns @ self.light + around)


def bounded(irradiance: Doubles) -> Doubles:
    """Never below `LEAST_LIGHT` of the usual."""
    return np.maximum(irradiance, LEAST_LIGHT * np.maximum(irradiance.mean(axis=0), 1e-6))


def fit_room(
    seen: Sightings, columns: Doubles, around: Doubles, start: Doubles | None = None,
    rounds: int = ROUNDS,
) -> RoomFit:  # fmt: skip
    """The light under which points have one albedo in all photos, and few albedos.

    columns: (m, 9 + k) irradiance of each sighting by each unknown of the light; around: (m, 3)
    that from the surface itself; start: a light to begin with, else alike from everywhere.
    """
    light = np.zeros((columns.shape[1], 3))
    if start is None:
        light[0] = 2.0 * seen.rgb.mean(axis=0) / 0.28
    else:
        light[: len(start)] = start
    centers: Doubles | None = None
    palette, rest = np.ones((1, 3)), np.zeros_like(around)
    for _ in range(rounds):
        irradiance = bounded(columns @ light + around)
        albedo = gauged(albedo_of(seen, irradiance), irradiance)
        known = seen.number > 0
        chroma = log_chroma(albedo)
        if centers is None:
            centers = clusters(chroma[known])
        centers = moved(chroma[known], centers, MOVES)
        label = members(chroma, centers)
        palette = medians(albedo[known], label[known], len(centers))
        light, rest = stepped(seen, columns, light, irradiance, palette[label])
    assert centers is not None
    return RoomFit(light, centers, palette, spread_of(rest))


def albedo_of(seen: Sightings, irradiance: Doubles) -> Doubles:
    """(count, 3) what each point reflects, robustly: least squares over its sightings."""
    weight = seen.trust.astype(np.float64)
    loss = np.ones(len(weight))
    albedo = np.zeros((seen.count, 3))
    for _ in range(3):
        w = (weight * loss)[:, None] * irradiance
        bottom = seen.sums(w * irradiance)
        albedo = np.pi * np.asarray(seen.sums(w * seen.rgb)) / np.maximum(bottom, 1e-20)
        told = (albedo[seen.point] * irradiance) @ LUMINANCE / np.pi
        off = np.log(np.maximum(seen.rgb @ LUMINANCE, DARKEST) / np.maximum(told, DARKEST))
        loss = 1 / (1 + (off / OUTLIER) ** 2)
    return albedo


def gauged(albedo: Doubles, irradiance: Doubles) -> Doubles:
    """The albedo of a light whose tint, in the geometric mean, is neutral, of median
    `MEAN_ALBEDO`: what colors alone cannot tell.
    """
    albedo = albedo * np.exp(np.log(irradiance).mean(axis=0))
    shown = albedo @ LUMINANCE
    level = float(np.median(shown[shown > 0])) if (shown > 0).any() else 1.0
    return albedo * ((MEAN_ALBEDO + GLOSS) / max(level, 1e-6))


def residuals(seen: Sightings, irradiance: Doubles, paint: Doubles) -> Doubles:
    """(m, 3) log of color over that of each point's paint (count, 3)."""
    told = np.maximum(paint[seen.point] * irradiance / np.pi, DARKEST)
    return np.log(np.maximum(seen.rgb, DARKEST) / told)


def own_part(number: Index) -> Doubles:
    """(n,) the part of its mean residual that is a point's own albedo, by its sightings; the root
    of the rest weighs differences between points (quasi-demeaning).
    """
    rest = WITHIN**2 / (WITHIN**2 + np.maximum(number, 1) * BETWEEN**2)
    return 1 - np.sqrt(rest)


def stepped(
    seen: Sightings, columns: Doubles, light: Doubles, irradiance: Doubles, paint: Doubles
) -> tuple[Doubles, Doubles]:
    """The light after a step of Gauss and Newton, and the residuals (m, 3) before it. Colors may be
    of one channel too, here and below.
    """
    off = residuals(seen, irradiance, paint)
    rest, weight = demeaned(seen, off)
    out = light.copy()
    part = own_part(seen.number)[seen.point][:, None]
    for k in range(light.shape[1]):
        slope = columns / irradiance[:, k : k + 1]
        slope = slope - part * point_means(seen, slope, weight)[seen.point]
        out[:, k] += _solved(slope, rest[:, k], weight, light[:, k], irradiance[:, k].mean())
    out[9:] = np.maximum(out[9:], 0)
    return out, rest


def spread_of(rest: Doubles) -> float:
    """Mean of |residuals (m, 3)|, cut at 1."""
    return float(np.minimum(np.abs(shown(rest)), 1).mean())


def shown(values: Doubles) -> Doubles:
    """(m,) luminance of (m, 3) or (m, 1)."""
    return values[:, 0] if values.shape[1] == 1 else values @ LUMINANCE


def demeaned(seen: Sightings, off: Doubles) -> tuple[Doubles, Doubles]:
    """Residuals (m, 3) less each point's own part, and (m,) weights."""
    weight = seen.trust.astype(np.float64)
    part = own_part(seen.number)[:, None]
    for _ in range(2):
        own = np.clip(point_means(seen, off, weight), -FARTHEST_PAINT, FARTHEST_PAINT)
        within = shown(off - own[seen.point])
        weight = seen.trust / (1 + (within / OUTLIER) ** 2)
    own = point_means(seen, off, weight)
    cut = np.clip(own, -FARTHEST_PAINT, FARTHEST_PAINT)
    return (off - own[seen.point]) + (cut - part * cut)[seen.point], weight


def _solved(
    slope: Doubles, rest: Doubles, weight: Doubles, light: Doubles, usual: float
) -> Doubles:
    """(c,) the step of one channel; harmonics above the constant one are pulled to 0."""
    left = slope * weight[:, None]
    pull = np.full(slope.shape[1], 1e-9 * weight.sum())
    pull[1:9] = RIDGE * weight.sum() * (np.pi * 0.28 / usual) ** 2
    gradient: Doubles = left.T @ rest - pull * light
    return np.asarray(np.linalg.solve(left.T @ slope + np.diag(pull), gradient))
