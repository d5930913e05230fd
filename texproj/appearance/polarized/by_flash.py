"""Paint and mirror under a polarized flash on the camera: how strongly and how sharply each paint
mirrors.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from texproj.appearance.flash.closed_form import (
    fit_each,
    fit_lambert,
    fit_material,
    labelled_terms,
    predicted,
)
from texproj.appearance.flash.found import HIGHLIGHT, photo_gains
from texproj.appearance.flash.held_out import held_out, plain_color
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.observations import Flashes, Observations
from texproj.appearance.flash.pooled import SMOOTH, Pooled
from texproj.appearance.flash.reflection import ROUGHNESSES, Material, lobe
from texproj.appearance.flash.sampled import (
    FlashSamples,
    FlashVertices,
    spread_vertices,
    subset,
)
from texproj.appearance.light_fit import MEAN_ALBEDO
from texproj.appearance.palette import clusters, log_chroma, members
from texproj.appearance.polarized.differences import Pairs, paired
from texproj.appearance.polarized.pair_verdict import PairVerdict, judged_pairs
from texproj.appearance.recovered import MATTE, Appearance, PolarizedLight, untold
from texproj.arrays import Bools, Doubles, Floats, Index
from texproj.color.filling.vertices import fill_vertices
from texproj.color.sampling.photo_set import PhotoSet
from texproj.mesh import Mesh
from texproj.photo import LUMINANCE
from texproj.render import Renderer
from texproj.resources.scratch import Scratch

FITTED = 12_000
"""Points by which paints and their mirrors are found."""

FEWEST = 300
"""Points that three photos show, below which nothing is told."""

PAINTS = 6
"""Hues, each with a roughness and a mirror of its own."""

EDGES = (0.6, 1.0, 1.4, 1.9, 2.5)
"""How bright matte paint is in grazing light that goes straight back, against Lambert's."""

ROUNDS = 3
OUTLIER = 2.0
"""Standard deviations at which an observation counts half (Cauchy)."""

READ_NOISE, SHOT_NOISE, MODEL_ERROR = 0.004, 1.5e-4, 0.1
"""Of a difference of photos of linear light y: variance READ_NOISE^2 + SHOT_NOISE y + (MODEL_ERROR
y)^2; edges of highlights lie a little elsewhere in the two.
"""

TELLING = 0.1
"""Part of the cost that a mirror has to explain to be known."""

FEWEST_LIT = 50
"""Points of a paint that saw their highlight, below which its mirror is not told."""

MOST_F0 = 0.95
VIEWS_HALF = 2.0
REFUSED = np.float32(0.1)

FEW = "too few photos show the same places: take more pairs, a good deal overlapping"

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Sets:
    """The photos of both polarizations, the same names and cameras; exposure: (p,) by how much more
    light each crossed photo gathered.
    """

    parallel: PhotoSet
    crossed: PhotoSet
    exposure: Floats


@dataclass(frozen=True, eq=False)
class Crossed:
    """What the crossed photos agree on at the vertices: rgb (V, 3) linear, seen (V,)."""

    rgb: Floats
    seen: Bools


def polarized_flash_appearance(
    mesh: Mesh, sets: Sets, renderer: Renderer, lamp: Lamp, blend: Crossed, progress: Progress
) -> Appearance:
    """The surface from pairs of photos under a flash through a polarizer. Where it does not explain
    crossed photos that were held out the base color is `blend`'s.
    """
    with closing(Scratch()) as scratch:
        owners = FlashVertices.of(mesh).owners
        dark, bright = (
            FlashSamples.of(
                mesh, FlashVertices(owners), photos, renderer, lamp, scratch,
                lambda done: progress("flash", done, len(photos)),  # noqa: B023 - called at once
            )
            for photos in (sets.crossed, sets.parallel)
        )  # fmt: skip
        area = np.square(owners.spacing.astype(np.float64))
        chosen = spread_vertices(area, blend.seen, FITTED)
        _, seen = subset(dark, chosen, lamp)
        _, shining = subset(bright, chosen, lamp)
        if np.count_nonzero(seen.number >= 3) < FEWEST:
            return _refused(blend, FEW, None)
        pairs = _paired(shining, seen, sets.exposure)
        if pairs.refusal:
            return _refused(blend, pairs.refusal, None)
        gain, verdict = _judged(seen, len(sets.crossed))
        if not verdict.accepted:
            return _refused(blend, verdict.refusal, verdict)
        seen = seen.scaled(gain[seen.photo])
        unit = _unit(seen, lamp)
        seen = seen.scaled(np.full(len(seen.point), unit, np.float32))
        paints = _paints(seen)
        kinds = _mirrors(seen, pairs, paints.labels(seen), len(paints.centers))
        flashes = dark.flashes.with_gain(gain * np.float32(unit))
        found = _Found(lamp, flashes, paints, kinds)
        made = _everywhere(mesh, dark, bright, sets, found, verdict)
    irradiance = (blend.rgb / np.maximum(made.base, np.float32(1e-3))).astype(np.float32)
    return replace(made, irradiance=irradiance)


@dataclass(frozen=True, eq=False)
class _Paints:
    """centers: (k, 2) log chroma; matte: how each paint fades towards edges."""

    centers: Doubles
    matte: list[Material]

    def labels(self, seen: Observations) -> Index:
        """(n,) the paint of each point."""
        return np.asarray(members(log_chroma(fit_lambert(seen).color), self.centers), np.intp)

    def colors(self, seen: Observations) -> Floats:
        """(n, 3) of each point."""
        return fit_each(seen, self.matte, self.labels(seen)).color

    def predicted(self, seen: Observations, color: Floats, label: Index) -> Floats:
        """(m, 3) what the crossed photos would show."""
        return predicted(*labelled_terms(seen, self.matte, label), seen, color)


def _paints(seen: Observations) -> _Paints:
    """Hues, and how strongly each shines at edges: rough paint more than Lambert has it."""
    color = fit_lambert(seen).color
    known = seen.number > 2
    centers = clusters(log_chroma(color[known]), PAINTS)
    label = members(log_chroma(color), centers)
    tried = [Material(1.0, False, 0.0, edge) for edge in EDGES]
    cost = np.stack([fit_material(seen, one).cost for one in tried], axis=1)
    sums = [np.bincount(label, one * known, len(centers)) for one in cost.T]
    best = np.argmin(np.stack(sums, axis=1), axis=1)
    return _Paints(centers, [tried[k] for k in best])


@dataclass(frozen=True, eq=False)
class _Found:
    lamp: Lamp
    flashes: Flashes
    paints: _Paints
    kinds: list[Pooled]


def _paired(shining: Observations, seen: Observations, exposure: Floats) -> Pairs:
    first, second = ((one.point, one.photo, one.rgb) for one in (shining, seen))
    return paired(first, second, exposure, each=True)


def _judged(seen: Observations, photos: int) -> tuple[Floats, PairVerdict]:
    """(p,) the output of each flash, and how well crossed photos held out are predicted."""
    held = np.zeros(photos, bool)
    held[held_out(photos)] = True
    out = held[seen.photo]
    train = seen.kept(~out)
    paints = _paints(train)
    color, label = paints.colors(train), paints.labels(train)
    gain = photo_gains(seen, paints.predicted(seen, color, label), photos)
    color = paints.colors(train.scaled(gain[train.photo]))
    test = seen.kept(out & (train.number >= 2)[seen.point])
    lit = paints.predicted(test, color, label)
    plain = plain_color(train)
    return gain, judged_pairs(test, plain[test.point], lit, int(held.sum()))


def _unit(seen: Observations, lamp: Lamp) -> float:
    """By how much light is more than was taken for 1: the median of the surface is that of usual
    surfaces where nobody knows how strong the flash is.
    """
    if lamp.intensity is not None:
        return 1.0
    color = fit_lambert(seen).color[seen.number > 2] @ LUMINANCE
    return max(float(np.median(color)) / MEAN_ALBEDO, 1e-9)


def _mirrors(seen: Observations, pairs: Pairs, label: np.ndarray, paints: int) -> list[Pooled]:
    """The roughness and the mirror of each paint, from all of its pairs together."""
    rows = pairs.crossed
    of_paint = label[seen.point[rows]]
    lit = seen.angles.nh[rows] >= HIGHLIGHT
    out = []
    for number in range(paints):
        part = np.flatnonzero(of_paint == number)
        points = len(np.unique(seen.point[rows[part[lit[part]]]]))
        told = _mirror(seen, rows[part], pairs.mirrored[part] @ LUMINANCE)
        known = told.f0_known and points >= FEWEST_LIT
        out.append(replace(told, f0_known=known, points=points))
    return out


def _mirror(seen: Observations, rows: np.ndarray, shown: Floats) -> Pooled:
    """Roughness by trial, the mirror in closed form."""
    a = seen.angles
    angles = type(a)(a.nl[rows], a.nv[rows], a.nh[rows], a.vh[rows])
    rise = (1 - angles.vh) ** 5
    light, trust = seen.light[rows], seen.trust[rows]
    spread = READ_NOISE**2 + SHOT_NOISE * np.abs(shown) + np.square(MODEL_ERROR * shown)
    matte = np.log1p(shown**2 / spread) @ trust
    best = (np.inf, Material(float(MATTE), False))
    for roughness in ROUGHNESSES:
        x = light * lobe(roughness, angles)
        slope, wanted = x * (1 - rise), shown - x * rise
        loss, f0 = np.ones_like(shown), 0.0
        for _ in range(ROUNDS):
            w = trust * loss / spread
            f0 = float(np.clip((w * slope) @ wanted / max(w @ slope**2, 1e-20), 0, MOST_F0))
            square = (wanted - f0 * slope) ** 2 / spread
            loss = 1 / (1 + square / OUTLIER**2)
        cost = float(np.log1p(square) @ trust)
        if cost < best[0]:
            best = (cost, Material(roughness, False, f0))
    known = best[0] < (1 - TELLING) * matte and best[1].roughness < SMOOTH
    return Pooled(best[1], bool(known), 0)


def _everywhere(
    mesh: Mesh, dark: FlashSamples, bright: FlashSamples, sets: Sets, found: _Found,
    verdict: PairVerdict,
) -> Appearance:  # fmt: skip
    """All vertices of the mesh."""
    count = len(mesh.vertices)
    color, number = np.zeros((count, 3), np.float32), np.zeros(count)
    mirrored, label = np.zeros(count, np.float32), np.zeros(count, np.intp)
    start = 0
    for chunk, size in enumerate(dark.points.sizes):
        for piece in dark.store.pieces(chunk):
            rows = slice(start + piece.start, start + piece.stop)
            seen = dark.observations(chunk, piece, found.flashes, found.lamp)
            shining = bright.observations(chunk, piece, found.flashes, found.lamp)
            color[rows], number[rows] = found.paints.colors(seen), seen.number
            label[rows] = found.paints.labels(seen)
            mirrored[rows] = _f0(
                seen, _paired(shining, seen, sets.exposure), label[rows], found.kinds
            )
        start += size
    known = number > 0
    base = fill_vertices(mesh, color, known)
    roughness, metallic = untold(count)
    rough = [k.material.roughness if k.f0_known else float(MATTE) for k in found.kinds]
    roughness = np.array(rough, np.float32)[label]
    names = sets.crossed.names
    output = dict(zip(names, map(float, found.flashes.gain), strict=True))
    light = PolarizedLight(found.lamp, tuple(found.kinds), label, output)
    sure = (number / (number + VIEWS_HALF)).astype(np.float32)
    return Appearance(
        base, roughness, metallic, None, sure, light, True, "",
        found.lamp.intensity is not None, verdict, mirrored,
    )  # fmt: skip


def _f0(seen: Observations, pairs: Pairs, label: np.ndarray, kinds: list[Pooled]) -> Floats:
    """(n,) what each point mirrors at normal incidence: its own where it saw its highlight, else
    its paint's, 0 where that is not known.
    """
    usual = np.array([k.material.f0 if k.f0_known else 0.0 for k in kinds], np.float32)[label]
    rough = np.array([k.material.roughness for k in kinds], np.float32)[label]
    rows, a = pairs.crossed, seen.angles
    point = seen.point[rows]
    angles = type(a)(a.nl[rows], a.nv[rows], a.nh[rows], a.vh[rows])
    x = seen.light[rows] * lobe(rough[point], angles)
    top = np.bincount(point, x * (pairs.mirrored @ LUMINANCE), seen.count)
    bottom = np.bincount(point, x * x, seen.count)
    own = np.clip(top / np.maximum(bottom, 1e-20), 0, MOST_F0)
    lit = np.zeros(seen.count, bool)
    lit[point[angles.nh >= HIGHLIGHT]] = True
    return np.where(lit & (usual > 0), own, usual).astype(np.float32)


def _refused(blend: Crossed, reason: str, verdict: PairVerdict | None) -> Appearance:
    base, little = np.clip(blend.rgb, 0, 1), np.where(blend.seen, REFUSED, np.float32(0))
    return Appearance(base, *untold(len(base)), None, little, None, False, reason, False, verdict)
