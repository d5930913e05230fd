"""The surface of an object that was turned before a camera that stood still, lamps beside it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from texproj.appearance.flash.sampled import shadows_of, spread_vertices
from texproj.appearance.harmonics import OPEN_GAINS, basis
from texproj.appearance.light_fit import GLOSS, MEAN_ALBEDO
from texproj.appearance.natural import Chart, base_color
from texproj.appearance.prediction import LEAST_GAIN_DB
from texproj.appearance.recovered import Appearance, TurntableLight, untold
from texproj.appearance.sightings import Readings, Sightings, point_means
from texproj.appearance.sun import spiral
from texproj.appearance.transfer import LightCaster
from texproj.appearance.turntable.around import AroundNodes
from texproj.appearance.turntable.lamps import RoomLamp, RoomLight
from texproj.appearance.turntable.room import Room
from texproj.appearance.turntable.room_fit import RoomFit, albedo_of, residuals, shown
from texproj.appearance.turntable.room_verdict import (
    OWN_GAIN_DB,
    RoomVerdict,
    held_out,
    judged,
)
from texproj.appearance.turntable.search import Lit, find_lamps
from texproj.arrays import Bools, Doubles, Floats, Index
from texproj.color.filling.vertices import fill_vertices
from texproj.color.sampling.photo_set import PhotoSet
from texproj.mesh import Mesh
from texproj.photo import LUMINANCE
from texproj.render import Renderer
from texproj.resources.scratch import Scratch

FITTED = 4000
"""Points by which the light is found, each in many photos."""

FEWEST = 400
"""Points that three photos show, below which no light is told."""

ROUNDS = 2
"""Of light, then the light that comes from the surface around and each photo's exposure."""

GAIN_SIGHTINGS = 50
"""Fewer tell no exposure of a photo."""

OFF_HALF = 0.25
"""Difference (log) between a point's photos at which confidence is a half."""

VIEWS_HALF = 2.0
"""Photos of a point at which confidence is a half."""

REFUSED = np.float32(0.1)
"""Confidence of colors from which no light was taken."""

NO_ROUND = (
    "the cameras do not go around the object, held level, so that no light was turned over it:"
    " photograph all around on a turntable"
)
FEW = "too little of the surface is seen by three photos to tell its light: take more photos"

Progress = Callable[[str, int, int], None]
"""``progress(what, done, total)``."""


@dataclass(frozen=True, eq=False)
class Blended:
    """What the photos agree on at the vertices: rgb (V, 3) linear light, also where they see
    nothing; seen (V,) where they do. chart: what a color chart has made absolute in rgb; matrix:
    (3, 3) linear light of photos to that, None without a chart; gloss: mean reflection that is none
    of the paint's, 0 where polarizers kept it out.
    """

    rgb: Floats
    seen: Bools
    chart: Chart = "none"
    matrix: Doubles | None = None
    gloss: float = GLOSS


@dataclass(frozen=True, eq=False)
class _Found:
    """A light: its fit with lamps, what it was fitted to, and what the nodes send in each photo
    (n, p, 3); gain: (p,) exposures.
    """

    fit: RoomFit
    lamps: list[RoomLamp]
    lit: Lit
    gain: Floats
    sent: Floats


def turntable_appearance(
    mesh: Mesh, photos: PhotoSet, renderer: Renderer, blend: Blended, unsaid: bool,
    progress: Progress,
) -> Appearance:  # fmt: skip
    """The surface itself, from photos of an object that was turned in light that stood still.

    unsaid: nobody said that it was, so that more is asked for. Where the light does not predict
    photos that were held out it is refused, and the base color is that of `blend`.
    """
    room = Room.of(photos.cameras)
    if room is None:
        return _refused(blend, NO_ROUND, None)
    with closing(Scratch()) as scratch:
        readings = Readings.of(
            mesh, photos, renderer, scratch, lambda done: progress("light", done, len(photos))
        )
        surface = _Surface(mesh, blend, readings, RoomLight(room, shadows_of(mesh), mesh.diagonal))
        chosen = surface.chosen
        if len(chosen) < FEWEST or (readings.of_vertices(chosen).number >= 3).sum() < FEWEST:
            return _refused(blend, FEW, None)
        found, verdict = surface.found(unsaid)
        if not verdict.accepted:
            return _refused(blend, verdict.refusal, verdict)
        count = len(mesh.vertices)
        base, reflected, sure, scale = surface.everywhere(
            found, lambda done: progress("appearance", done, count)
        )
    known = sure > 0
    base = fill_vertices(mesh, base, known)
    effective = blend.rgb / np.maximum(fill_vertices(mesh, reflected, known), 1e-3)
    light = TurntableLight(
        found.fit.light[:9] / scale, tuple(found.lamps), found.fit.light[9:] / scale,
        dict(zip(photos.names, map(float, found.gain), strict=True)),
    )  # fmt: skip
    return Appearance(
        base, *untold(count), effective.astype(np.float32), sure * blend.seen, light, True, "",
        blend.chart == "scale" and not any(lamp.near for lamp in found.lamps), verdict,
    )  # fmt: skip


def _refused(blend: Blended, reason: str, verdict: RoomVerdict | None) -> Appearance:
    base, little = np.clip(blend.rgb, 0, 1), np.where(blend.seen, REFUSED, np.float32(0))
    return Appearance(base, *untold(len(base)), None, little, None, False, reason, False, verdict)


class _Surface:
    """A mesh, its photos and the room."""

    def __init__(self, mesh: Mesh, blend: Blended, readings: Readings, light: RoomLight) -> None:
        self._blend, self._readings, self._light = blend, readings, light
        self._caster = LightCaster(mesh, blend.rgb)
        area = np.square(readings.points.owners.spacing.astype(np.float64))
        chosen = spread_vertices(area, blend.seen, FITTED)
        self.chosen: Index = chosen[readings.of_vertices(chosen).number > 0]

    def found(self, unsaid: bool) -> tuple[_Found, RoomVerdict]:
        """The light by the chosen points, judged by photos that were held out, then by all. unsaid:
        nobody said that there is one; lamps are sought only where even a sky explains the photos.
        """
        least_db = OWN_GAIN_DB if unsaid else LEAST_GAIN_DB
        chosen, room = self.chosen, self._light.room
        seen, surfels = (
            self._in_chart(self._readings.of_vertices(chosen)),
            self._readings.surfel(chosen),
        )
        transfer = self._caster.transfer(chosen)
        sky = transfer.sky.astype(np.float64)
        lit = Lit(
            surfels, seen, _turned(sky, seen, room),
            transfer.indirect[seen.point].astype(np.float64), np.zeros((len(seen.point), 0)),
        )  # fmt: skip
        self._nodes = nodes = AroundNodes(self._light, surfels, sky)
        held = held_out(len(room.harmonics))
        train = ~held[seen.photo]
        part = lit.kept(train)
        fit, gain = part.fit(), np.ones(len(held), np.float32)
        sent = np.zeros((len(chosen), len(held), 3), np.float32)
        early = judged(seen, fit.irradiance(lit.columns, lit.around), held, least_db)
        if unsaid and not early.accepted:
            return _Found(fit, [], lit, gain, sent), early
        lamps, _, fit = find_lamps(self._light, part, fit)
        for lamp in lamps:
            lit = lit.with_lamp(self._light, lamp)
        for _ in range(ROUNDS):
            lit, gain, sent = self._closer(lit, fit, lamps, nodes, gain)
            fit = lit.kept(train).fit(fit.light)
        verdict = judged(lit.seen, fit.irradiance(lit.columns, lit.around), held, least_db)
        fit = lit.fit(fit.light)
        return _Found(fit, lamps, lit, gain, sent), verdict

    def _closer(
        self, lit: Lit, fit: RoomFit, lamps: list[RoomLamp], nodes: AroundNodes, gain: Floats
    ) -> tuple[Lit, Floats, Floats]:
        """With the light from around and the photos' exposures as this light tells them."""
        irradiance = fit.irradiance(lit.columns, lit.around)
        more = exposures(lit.seen, irradiance, len(gain))
        seen = lit.seen.scaled(more)
        sent = nodes.sent(albedo_of(seen, irradiance), fit.light, lamps)
        arriving = nodes.arriving(sent, seen.point, seen.photo)
        return replace(lit, seen=seen, around=arriving), gain * more, sent

    def everywhere(
        self, found: _Found, progress: Callable[[int], None]
    ) -> tuple[Floats, Floats, Floats, Doubles]:
        """(V, 3) base colors, (V, 3) what is reflected, (V,) confidence of all vertices, and the
        scale (3,) by which albedos in the fit's unit become reflectances.
        """
        scale = self._scale(found)
        count = len(self._blend.rgb)
        reflected = np.zeros((count, 3), np.float32)
        sure = np.zeros(count, np.float32)
        for chunk in range(len(self._readings.points.sizes)):
            for piece in self._readings.store.pieces(chunk):
                rows, seen = self._readings.of_chunk(chunk, piece)
                seen = self._in_chart(seen).scaled(found.gain)
                irradiance = self._irradiance(found, rows, seen)
                albedo = albedo_of(seen, irradiance)
                reflected[rows] = albedo * scale
                sure[rows] = _confidence(seen, irradiance, albedo)
                progress(rows.stop)
        return base_color(reflected, self._blend.gloss), reflected, sure, scale

    def _irradiance(self, found: _Found, rows: slice, seen: Sightings) -> Doubles:
        surfels = self._readings.surfel(rows)
        sky = self._caster.transfer(np.arange(rows.start, rows.stop)).sky.astype(np.float64)
        around = self._nodes.arriving_at(surfels, found.sent, seen.point, seen.photo)
        lit = Lit(
            surfels, seen, _turned(sky, seen, self._light.room), around,
            np.zeros((len(seen.point), 0)),
        )  # fmt: skip
        for lamp in found.lamps:
            lit = lit.with_lamp(self._light, lamp)
        return found.fit.irradiance(lit.columns, lit.around)

    def _scale(self, found: _Found) -> Doubles:
        """As in natural light: by the chart's, else by neutral light and a mean albedo."""
        light = found.fit.irradiance(found.lit.columns, found.lit.around)
        charted = _brightest(found)
        if self._blend.chart == "scale":
            return charted / np.pi
        tint = np.exp(np.log(light).mean(axis=0)) if self._blend.chart == "none" else charted
        albedo = albedo_of(found.lit.seen, light)[found.lit.seen.number > 0] * tint
        return tint * (MEAN_ALBEDO + self._blend.gloss) / float((albedo @ LUMINANCE).mean())

    def _in_chart(self, seen: Sightings) -> Sightings:
        """In the colors of the chart, as bright as the blend."""
        matrix = self._blend.matrix
        return seen if matrix is None else replace(seen, rgb=seen.rgb @ matrix.T.astype(np.float32))


def _turned(sky: Doubles, seen: Sightings, room: Room) -> Doubles:
    """(m, 9) irradiance of sightings by the harmonics of the room, of points' transfer (n, 9)."""
    out = np.empty((len(seen.point), sky.shape[1]))
    for photo, matrix in enumerate(room.harmonics):
        rows = np.flatnonzero(seen.photo == photo)
        out[rows] = sky[seen.point[rows]] @ matrix
    return out


def exposures(seen: Sightings, irradiance: Doubles, photos: int) -> Floats:
    """(p,) how much brighter each photo is than its light tells, geometric mean 1."""
    off = residuals(seen, irradiance, np.ones((seen.count, 3)))
    own = point_means(seen, off, seen.trust.astype(np.float64))
    rest = shown(off - own[seen.point])
    out = np.zeros(photos)
    for photo in range(photos):
        rows = (seen.photo == photo) & (seen.number[seen.point] > 1)
        if np.count_nonzero(rows) >= GAIN_SIGHTINGS:
            out[photo] = np.median(rest[rows])
    return np.exp(out - out.mean()).astype(np.float32)


def _brightest(found: _Found) -> Doubles:
    """(3,) irradiance of an open surface that faces the light best."""
    normals = spiral(500)
    light = basis(normals) * OPEN_GAINS @ found.fit.light[:9]
    for lamp, strength in zip(found.lamps, found.fit.light[9:], strict=True):
        light = light + np.maximum(normals @ lamp.direction, 0)[:, None] * strength
    return np.maximum(light[np.argmax(light @ LUMINANCE)], 1e-6)


def _confidence(seen: Sightings, irradiance: Doubles, albedo: Doubles) -> Floats:
    """(n,) 0 where a point is not seen; low where few photos see it or they differ."""
    off = np.abs(shown(residuals(seen, irradiance, np.maximum(albedo, 1e-6))))
    usual = point_means(seen, off[:, None], seen.trust.astype(np.float64))[:, 0]
    views = seen.number / (seen.number + VIEWS_HALF)
    return (views / (1 + (usual / OFF_HALF) ** 2)).astype(np.float32)
