"""The materials of a surface and the output of each flash, from points spread over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from texproj.appearance.flash.bounce import BounceField, Hits, Nodes, bounced, surface_hits
from texproj.appearance.flash.closed_form import (
    Fit,
    fit_each,
    fit_lambert,
    fit_material,
    labelled_terms,
    predicted,
)
from texproj.appearance.flash.few_views import ENOUGH
from texproj.appearance.flash.head_on import Witnesses
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.materials import base_materials
from texproj.appearance.flash.observations import (
    Flashes,
    LampShadows,
    Observations,
    Surfel,
    dots,
)
from texproj.appearance.flash.pooled import Pooled, flattened, pooled
from texproj.appearance.flash.reflection import CANDIDATES, Material
from texproj.appearance.flash.voting import Voters, near_neighbors, settled, smoothed
from texproj.appearance.light_fit import MEAN_ALBEDO
from texproj.arrays import Floats, Index
from texproj.photo import LUMINANCE

HIGHLIGHT = 0.93
"""Cosine of normal and half vector from which on a metal shows what it is."""

METAL_LIT = 0.1
"""Least part of the points of a metal that have to have seen their highlight."""

ALIKE, ROUGH, ROUGH_ALIKE = 0.05, 0.4, 0.2
"""Roughness by which two materials of one kind, pooled, have to differ; from `ROUGH` on light from
around and rough normals part what is one.
"""

FRONTAL, BRIGHT = 0.4, 0.02
"""Cosine to the eye, and linear light, from which on an observation tells its flash's output."""

BRIGHT_ALBEDO, BRIGHT_PART = 0.8, 0.95
"""Brightest channel that this part of all points keeps below, where nothing tells the strength of
the flash: colors that end at 1 would be cut.
"""

WITNESSED = 4
"""Observations of a point that knows whether it is metal."""

GAIN_ROUNDS = 2
ROUNDS = 2
"""Of materials: the first without a bounce, the second with it."""

BALANCE_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Found:
    """What the surface is made of.

    materials: by label; flashes: with their gains; lamp: with an intensity; field: light from the
    surface around; voters: who tells the material of other points; surfels, seen, label, fit,
    neighbors, hits: the points that it was found from; assumed: the lamp's intensity was not given.
    """

    materials: tuple[Pooled, ...]
    flashes: Flashes
    lamp: Lamp
    field: BounceField
    voters: Voters
    surfels: Surfel
    seen: Observations
    label: Index
    fit: Fit
    shadows: LampShadows
    neighbors: Any
    hits: Hits
    assumed: bool
    diagonal: float

    @property
    def kinds(self) -> list[Material]:
        return [one.material for one in self.materials]

    @cached_property
    def flat_color(self) -> Floats:
        """(n, 3) of the points by the materials as they are where the surface is flat."""
        flat = [replace(one.material, roughness=one.roughness) for one in self.materials]
        return fit_each(self.seen, flat, self.label).color

    @cached_property
    def witnesses(self) -> Witnesses | None:
        """The points that saw their highlight often enough, and lie amid others of their party."""
        metal = np.array([kind.metal for kind in self.kinds], np.float32)[self.label]
        amid = np.abs(self.neighbors @ metal - metal) < np.float32(1e-3)
        lit = self.seen.nearest_highlight() >= HIGHLIGHT
        knows = amid & lit & (self.seen.number >= WITNESSED)
        given = self.surfels.xyz, self.fit.color, self.label, knows
        return Witnesses.of(*given, self.kinds, self.diagonal)


@dataclass(eq=False)
class _Search:
    """Points of a surface, and what is known of it so far."""

    surfels: Surfel
    seen: Observations
    flashes: Flashes
    lamp: Lamp
    shadows: LampShadows
    diagonal: float
    neighbors: Any
    hits: Hits

    def scale(self, factor: float) -> None:
        """The light is that much stronger."""
        self.seen = self.seen.scaled(np.full(len(self.seen.point), factor, np.float32))
        assert self.lamp.intensity is not None
        self.lamp = replace(self.lamp, intensity=self.lamp.intensity * factor)

    def gains(self, told: Floats) -> None:
        """Each flash's output, by the median ratio of what is seen to what is predicted (m, 3)."""
        gain = photo_gains(self.seen, told, len(self.flashes.cameras))
        used = np.unique(self.seen.photo)
        gain[used] /= np.exp(np.log(gain[used]).mean())
        self.seen = self.seen.scaled(gain[self.seen.photo])
        self.flashes = self.flashes.with_gain(self.flashes.gain * gain)

    def volume(self, materials: Sequence[Material]) -> tuple[list[Fit], Floats]:
        """The fit of each material, and (n, k) their costs."""
        fits = [fit_material(self.seen, material) for material in materials]
        return fits, np.stack([fit.cost for fit in fits], axis=1)

    def even(self, cost: Floats) -> Floats:
        """(n, k) costs of `CANDIDATES` without the noise of single points, sharp ones dearer. One
        or two observations fit any, so that such points tell nothing.
        """
        sharp = np.array([material.sharpness for material in CANDIDATES], np.float32)
        return smoothed(cost, self.seen.number >= ENOUGH, self.neighbors) + sharp

    def settle(self, materials: Sequence[Material], rgb: Floats) -> tuple[Index, Voters]:
        """(n,) the material of each point."""
        _, cost = self.volume(materials)
        known = self.seen.number >= ENOUGH
        voters = Voters.of(self.surfels.xyz, rgb, cost, known, self.diagonal)
        votes = voters.votes(self.surfels.xyz, rgb)
        return settled(cost, votes, self.neighbors)[0], voters

    def balance(self, kinds: Sequence[Material], label: Index) -> None:
        """Outputs and colors in turns: either hides in the other for a while."""
        for _ in range(BALANCE_ROUNDS):
            color = fit_each(self.seen, kinds, label).color
            self.gains(predicted(*labelled_terms(self.seen, kinds, label), self.seen, color))

    def bounce(self, nodes: Nodes) -> BounceField:
        """Light from the surface around, put into the observations."""
        shown = np.zeros((self.seen.count, len(self.flashes.cameras)), np.float32)
        shown[self.seen.point, self.seen.photo] = 1
        wanted = shown + self.neighbors @ shown > 0
        around = bounced(nodes, self.hits, self.flashes, self.lamp, self.shadows, wanted)
        self.seen = replace(self.seen, around=around[self.seen.point, self.seen.photo])
        return BounceField(self.surfels, around)


def find_materials(
    surfels: Surfel, seen: Observations, flashes: Flashes, lamp: Lamp, shadows: LampShadows,
    diagonal: float,
) -> Found:  # fmt: skip
    """The materials that explain points best, colors free.

    seen: under an intensity of 1 where the lamp's is not known: then it is set so that matte colors
    are as usual (`_usual_strength`). Gloss of paint, which mirrors 4 %, would tell it, but that
    goes astray as soon as highlights are not quite those of the model.
    """
    near = near_neighbors(surfels.xyz, surfels.normal)
    hits = surface_hits(shadows, surfels)
    known = lamp.intensity is not None
    lamp = lamp if known else replace(lamp, intensity=1.0)
    search = _Search(surfels, seen, flashes, lamp, shadows, diagonal, near, hits)
    matte = fit_lambert(search.seen)
    if not known:
        search.scale(_usual_strength(search.seen))
        matte = fit_lambert(search.seen)
    search.gains(_matte_prediction(search.seen, matte))
    for _ in range(GAIN_ROUNDS):
        fits, cost = search.volume(CANDIDATES)
        search.gains(_best_prediction(search.seen, fits, np.argmin(search.even(cost), axis=1)))
    kinds = [CANDIDATES[k] for k in base_materials(search.even(search.volume(CANDIDATES)[1]))]
    field, label = None, None
    for _ in range(ROUNDS):
        rgb = fit_lambert(search.seen).color
        label, voters = search.settle(kinds, rgb)
        told, label = _merged(pooled(search.seen, label, kinds), label, search.seen)
        kinds = [one.material for one in told]
        fit = fit_each(search.seen, kinds, label)
        field = search.bounce(Nodes(surfels, fit.color, label, kinds))
        search.balance(kinds, label)
    label, voters = search.settle(kinds, fit_lambert(search.seen).color)
    fit = fit_each(search.seen, kinds, label)
    assert field is not None
    return Found(
        tuple(replace(one, f0_known=one.f0_known and known) for one in told),
        search.flashes, search.lamp, field, voters, surfels, search.seen, label, fit,
        shadows, near, hits, not known, diagonal,
    )  # fmt: skip


def completed(found: Found, seen: Observations) -> Found:
    """The same with the observations of all photos, those that were held out of the search too:
    each flash's output by what is predicted of it, the materials as they look there, and their
    roughness where the surface is flat: where it bends normals are off, and light comes from
    around, so that mirrors look rougher.

    seen: all observations of the same points, as given to `find_materials`.
    """
    given = found.lamp.intensity if found.assumed else 1.0
    assert given is not None
    seen = seen.scaled(np.float32(given) * found.flashes.gain[seen.photo])
    shown = np.zeros((seen.count, len(found.flashes.cameras)), np.float32)
    shown[seen.point, seen.photo] = 1
    wanted = shown + found.neighbors @ shown > 0
    nodes = Nodes(found.surfels, found.fit.color, found.label, found.kinds)
    around = bounced(nodes, found.hits, found.flashes, found.lamp, found.shadows, wanted)
    seen = replace(seen, around=around[seen.point, seen.photo])
    told = predicted(*labelled_terms(seen, found.kinds, found.label), seen, found.fit.color)
    gain = photo_gains(seen, told, len(found.flashes.cameras))
    gain[np.unique(found.seen.photo)] = 1
    seen = seen.scaled(gain[seen.photo])
    normal = found.surfels.normal
    clear = dots(normal, found.neighbors @ normal).clip(0, 1)
    clear += seen.nearest_highlight() >= HIGHLIGHT
    return replace(
        found,
        materials=tuple(flattened(seen, found.label, found.materials, clear)),
        seen=seen,
        field=BounceField(found.surfels, around * gain[:, None]),
        flashes=found.flashes.with_gain(found.flashes.gain * gain),
    )


def _usual_strength(seen: Observations) -> float:
    """How strong the flash is where colors are as usual: their median `MEAN_ALBEDO`, but the
    brighter ones no more than `BRIGHT_ALBEDO`, since metals that look black make the median dark.
    """
    under = seen.kept(seen.number[seen.point] > 2)
    plain = under.sums(under.rgb * under.light[:, None])
    square = under.sums(np.square(under.light)[:, None])
    color = np.pi * plain[under.number > 0] / np.maximum(square[under.number > 0], 1e-20)
    if not len(color):
        return 1.0
    usual = float(np.median(color @ LUMINANCE)) / MEAN_ALBEDO
    brightest = float(np.quantile(color.max(axis=1), BRIGHT_PART)) / BRIGHT_ALBEDO
    return max(usual, brightest, 1e-12)


def _merged(told: list[Pooled], label: Index, seen: Observations) -> tuple[list[Pooled], Index]:
    """Materials that differ by nothing become one; a metal that hardly any point saw mirror is
    none.
    """
    lit = seen.nearest_highlight() >= HIGHLIGHT
    kept: list[Pooled] = []
    new = np.zeros(len(told), np.intp)
    order = sorted(range(len(told)), key=lambda k: -np.count_nonzero(label == k))
    for number in order:
        one = told[number]
        of_it = label == number
        if one.material.metal and len(told) > 1 and lit[of_it].mean() < METAL_LIT:
            continue
        same = [k for k, other in enumerate(kept) if _alike(one.material, other.material)]
        new[number] = same[0] if same else len(kept)
        if not same:
            kept.append(one)
    if not kept:
        one = told[order[0]]
        kept = [Pooled(Material(one.material.roughness, False), False, one.points)]
    return kept, new[label]


def _alike(one: Material, other: Material) -> bool:
    least = ROUGH_ALIKE if min(one.roughness, other.roughness) >= ROUGH else ALIKE
    return one.metal == other.metal and abs(one.roughness - other.roughness) < least


def photo_gains(seen: Observations, told: Floats, photos: int) -> Floats:
    """(p,) median ratio of the luminance seen to that predicted (m, 3), 1 where none is seen."""
    shown, wanted = seen.rgb @ LUMINANCE, told @ LUMINANCE
    good = (seen.angles.nv > FRONTAL) & (shown > BRIGHT) & (wanted > BRIGHT)
    out = np.ones(photos, np.float32)
    for photo in range(photos):
        rows = good & (seen.photo == photo)
        if np.count_nonzero(rows) >= 20:
            out[photo] = np.median(shown[rows] / wanted[rows])
    return out


def _matte_prediction(seen: Observations, matte: Fit) -> Floats:
    return (seen.light / np.float32(np.pi))[:, None] * matte.color[seen.point]


def _best_prediction(seen: Observations, fits: list[Fit], best: Index) -> Floats:
    colors = np.stack([fit.color for fit in fits])
    color = colors[best, np.arange(len(best))]
    return predicted(*labelled_terms(seen, CANDIDATES, best), seen, color)
