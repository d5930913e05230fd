"""Natural light, unknown: what is light and what is paint in the colors of the surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.harmonics import OPEN_GAINS, basis
from texproj.appearance.light_fit import (
    GLOSS,
    MEAN_ALBEDO,
    LightFit,
    LitPoints,
    fit_light,
)
from texproj.appearance.nearby import told_nearby
from texproj.appearance.recovered import Appearance, NaturalLight, untold
from texproj.appearance.sun import angle_deg, find_sun, spiral
from texproj.appearance.transfer import LightCaster
from texproj.appearance.verdict import Places, Verdict, judged
from texproj.arrays import Bools, Doubles, Floats, Index
from texproj.color.filling.vertices import fill_vertices
from texproj.mesh import Mesh, face_areas
from texproj.photo import LUMINANCE

FITTED = 6000
"""Points by which the light is found: it has 30 numbers."""

FEWEST = 400
"""Fewer points of known color tell no light; a quarter of them in each half."""

DARK, CLIPPED = 2e-3, 0.9
"""Linear light between which a color is known."""

SUN_GAIN = 0.08
"""Part of the spread that a sun has to explain: a false one explains up to 4 %, a true one 13 to
35 %, the less the more the paint varies."""

SUNS_APART_DEG = 5.0
"""Farthest that the suns of both halves of the surface may be from each other."""

OFF_HALF = 0.3
"""Difference (log) from the paint's usual albedo at which confidence is a half."""

REFUSED = np.float32(0.1)
"""Confidence of colors from which no light was taken."""

CHUNK = 1 << 16
"""Vertices at a time."""

FEW = "too little of the surface is seen to tell its light: register more photos"
BADLY_EXPOSED = (
    "most of the surface is too dark or overexposed in the photos to tell its light: expose it anew"
)

Progress = Callable[[int, int], None]
Chart = Literal["none", "tint", "scale"]


@dataclass(frozen=True, eq=False)
class _Found:
    """A light, the points that it was fitted to, and the verdict on it."""

    fit: LightFit
    points: LitPoints
    to_sun: Doubles | None
    verdict: Verdict


def natural_appearance(
    mesh: Mesh,
    rgb: Floats,
    seen: NDArray[np.bool_],
    chart: Chart = "none",
    progress: Progress | None = None,
    gloss: float = GLOSS,
) -> Appearance:
    """The base color of the surface, and the light of the day.

    rgb: (V, 3) linear light that the photos agree on, also where they see nothing; seen: (V,)
    where they do; chart: what a color chart that faced the light has made absolute in rgb;
    progress: called with vertices done and vertices in all; gloss: mean reflection that is none of
    the paint's, 0 where polarizers kept it out. One light for all photos; the surface is taken for
    matte, but for that.

    Where the light is refused the base color is `rgb` itself, so that it is never worse.
    """
    caster = LightCaster(mesh, rgb)
    chosen = _chosen(mesh, rgb, seen)
    places = Places.of(caster.xyz[chosen], mesh.diagonal)
    if min(places.half.sum(), (~places.half).sum()) < FEWEST / 4:
        few = np.count_nonzero(seen) < 2 * FEWEST
        return _refused(rgb, seen, FEW if few else BADLY_EXPOSED, None)
    found = _found(caster, rgb, chosen, places)
    if not found.verdict.accepted:
        return _refused(rgb, seen, found.verdict.refusal, found.verdict)
    factor = _factor(found, chart, gloss)
    irradiance, confidence = _everywhere(caster, rgb, found, factor, progress)
    base = base_color(rgb / irradiance, gloss)
    base = fill_vertices(mesh, base, seen)
    light = NaturalLight(found.fit.sky / factor, found.to_sun, None)
    if found.fit.sun is not None:
        light = replace(light, sun=found.fit.sun / factor)
    return Appearance(
        base, *untold(len(base)), irradiance, confidence * seen, light, True, "",
        chart == "scale", found.verdict,
    )  # fmt: skip


def _refused(rgb: Floats, seen: Bools, reason: str, verdict: Verdict | None) -> Appearance:
    base, little = np.clip(rgb, 0, 1), np.where(seen, REFUSED, np.float32(0))
    return Appearance(base, *untold(len(base)), None, little, None, False, reason, False, verdict)


def _chosen(mesh: Mesh, rgb: Floats, seen: Bools) -> Index:
    """Vertices whose color is known, spread over the surface by area."""
    area = np.bincount(mesh.faces.ravel(), np.repeat(face_areas(mesh), 3), len(mesh.vertices))
    known = seen & (rgb.max(axis=1) < CLIPPED) & (rgb.min(axis=1) > DARK) & (area > 0)
    rows = np.flatnonzero(known)
    if len(rows) <= FITTED:
        return rows
    part = area[rows] / area[rows].sum()
    return np.sort(np.random.default_rng(0).choice(rows, FITTED, replace=False, p=part))


def _found(caster: LightCaster, rgb: Floats, chosen: Index, places: Places) -> _Found:
    """The light that explains the chosen vertices best: a sky, with a sun where there is one."""
    points = LitPoints(rgb[chosen].astype(np.float64), caster.transfer(chosen))
    sky = fit_light(points)
    to_sun, lit = find_sun(caster, chosen, points, sky)
    sunny = fit_light(lit, sky)
    if sunny.spread <= (1 - SUN_GAIN) * sky.spread and _same_sun(
        caster, chosen, points, places.half, sky
    ):
        told = told_nearby(lit, sunny, places.cell)
        return _Found(told, lit, to_sun, judged(lit, places, sky))
    return _Found(told_nearby(points, sky, places.cell), points, None, judged(points, places, sky))


def _same_sun(
    caster: LightCaster, chosen: Index, points: LitPoints, half: Bools, sky: LightFit
) -> bool:
    """Whether both halves of the surface, each alone, put the sun at the same place."""
    suns = []
    for part in (half, ~half):
        alone = points.take(part)
        suns.append(find_sun(caster, chosen[part], alone, fit_light(alone, sky))[0])
    return angle_deg(*suns) <= SUNS_APART_DEG


def _factor(found: _Found, chart: Chart, gloss: float) -> Doubles:
    """(3,) the irradiance, over pi, under which a surface shows its base color.

    With a chart: that of an open surface that faces the light best, as the chart did. Without,
    light is taken for neutral in the geometric mean over the points. Where no chart tells the
    scale their mean albedo is taken for `MEAN_ALBEDO`.
    """
    light = found.fit.irradiance(found.points)
    charted = _brightest(found) / np.pi
    if chart == "scale":
        return charted
    tint = np.exp(np.log(light).mean(axis=0)) if chart == "none" else charted
    albedo = np.pi * found.points.rgb / light * tint
    return tint * (MEAN_ALBEDO + gloss) / float((albedo @ LUMINANCE).mean())


def _brightest(found: _Found) -> Doubles:
    """(3,) irradiance of the open surface that gets most light."""
    normals = spiral(500)
    light = basis(normals) * OPEN_GAINS @ found.fit.sky
    if found.fit.sun is not None and found.to_sun is not None:
        light = light + np.maximum(normals @ found.to_sun, 0)[:, None] * found.fit.sun
    return np.maximum(light[np.argmax(light @ LUMINANCE)], 1e-6)


def _everywhere(
    caster: LightCaster, rgb: Floats, found: _Found, factor: Doubles, progress: Progress | None
) -> tuple[Floats, Floats]:
    """(V, 3) irradiance over pi and (V,) confidence of all vertices."""
    count = len(rgb)
    irradiance = np.empty((count, 3), np.float32)
    confidence = np.empty(count, np.float32)
    for start in range(0, count, CHUNK):
        rows = np.arange(start, min(start + CHUNK, count))
        points = LitPoints(rgb[rows].astype(np.float64), caster.transfer(rows))
        if found.to_sun is not None:
            sun = caster.sun_on(rows, found.to_sun).astype(np.float64)
            points = replace(points, sun=sun)
        light = found.fit.irradiance(points)
        irradiance[rows] = light / np.pi / factor
        told = found.fit.predicted(points) @ LUMINANCE
        off = np.log(np.maximum(points.rgb @ LUMINANCE, 1e-4) / np.maximum(told, 1e-4))
        confidence[rows] = 1 / (1 + (off / OFF_HALF) ** 2)
        if progress:
            progress(len(rows) + start, count)
    return irradiance, confidence


def base_color(reflected: Floats, gloss: float = GLOSS) -> Floats:
    """(n, 3) base color, 0..1, of what a surface reflects of its irradiance: less the gloss of a
    dielectric, but no less than a quarter, which gloss never is the rest of.
    """
    return np.clip(np.maximum(reflected - np.float32(gloss), reflected / 4), 0, 1)
