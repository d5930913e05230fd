"""The color and material of every point, from the few materials that the surface is made of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from texproj.appearance.flash.closed_form import (
    CAUCHY_ROUNDS,
    fit_lambert,
    fit_terms,
    model_terms,
)
from texproj.appearance.flash.few_views import ENOUGH, drawn_together
from texproj.appearance.flash.found import HIGHLIGHT, Found
from texproj.appearance.flash.observations import Observations, Surfel, observe
from texproj.appearance.flash.sampled import FlashSamples
from texproj.appearance.flash.tilt import Turning, tilts
from texproj.appearance.flash.voting import (
    mesh_neighbors,
    place_and_chroma,
    settled,
    smoothed,
)
from texproj.arrays import Bools, Floats, Index
from texproj.color.filling.vertices import fill_vertices
from texproj.mesh import Mesh

MIRRORS, MIRRORED = 64, 0.1
"""Metal nearby (`MIRRORED` of the diagonal counts like `CHROMA`), and of like hue, that saw its
highlight, whose median tells the color of metals: a single point knows it to a tenth only.
"""

OWN = 0.1
"""What a metal's own color counts for, where it saw its highlight."""

FARTHEST = 0.15
"""Of the diagonal: farther from any metal that was seen to mirror nothing is called one."""

RINGS = 12
"""Of neighbors, as far as that reaches."""

HALF = 2.0
"""Observations at which confidence is half."""

UNLIT = 0.5
"""What is left of it for a point that did not see its highlight: its gloss is that of others."""


@dataclass(frozen=True, eq=False)
class Points:
    """Of n points: color (n, 3), label (n,) into the materials, sure (n,) 0..1, number (n,) of
    observations, normal (n, 3) unit.
    """

    color: Floats
    label: Index
    sure: Floats
    number: Index
    normal: Floats

    @property
    def seen(self) -> Bools:
        return self.number > 0


@dataclass(frozen=True, eq=False)
class _Tried:
    """Of n points and k materials: cost (n, k), told (n, 2) what witnesses say of paint and metal,
    colors (n, k, 3), matte (n, 3), number and nearest highlight (n,), normal (n, 3).
    """

    cost: Floats
    told: Floats
    colors: Floats
    matte: Floats
    number: Index
    highlight: Floats
    normal: Floats


def points_of(
    samples: FlashSamples, found: Found, number: int
) -> Iterator[tuple[slice, Surfel, Observations]]:
    """The pieces of a chunk, with what the photos say of them."""
    surfel = samples.points.surfel(number)
    for piece in samples.store.pieces(number):
        part = Surfel(surfel.xyz[piece], surfel.normal[piece])
        shown = samples.read(number, piece)
        seen = observe(part, shown, found.flashes, found.lamp, samples.shadows)
        around = found.field.at(part, seen.point, seen.photo)
        yield piece, part, replace(seen, around=around)


def vertices_everywhere(
    mesh: Mesh, samples: FlashSamples, found: Found, progress: Callable[[int], None]
) -> Points:
    """All vertices of the mesh. progress: called with the number of vertices that are done."""
    tried, done = [], 0
    for number in range(len(samples.points.sizes)):
        for _, part, seen in points_of(samples, found, number):
            tried.append(_tried(part, seen, found))
            done += len(part.xyz)
            progress(done)
    whole = _Tried(*(np.concatenate([getattr(t, k) for t in tried]) for k in vars(tried[0])))
    xyz = (mesh.vertices - mesh.center).astype(np.float32)
    near = mesh_neighbors(mesh.faces, len(xyz))
    known = whole.number >= ENOUGH
    spread = smoothed(whole.cost, known, near, RINGS)
    cost = np.where(known[:, None], whole.cost, spread)
    matte = fill_vertices(mesh, whole.matte, known)
    votes = found.voters.votes(xyz, matte)
    if found.witnesses is not None:
        some = whole.number > 0
        told = np.where(some[:, None], whole.told, smoothed(whole.told, some, near, RINGS))
        cost, votes = found.witnesses.judged(cost, told, votes, matte)
    label, sure = settled(cost, votes, near)
    points = _chosen(xyz, whole, label, sure, found)
    paint = ~np.array([kind.metal for kind in found.kinds])[points.label]
    color = drawn_together(points.color, points.label, points.number, paint, near)
    return replace(points, color=color)


def texels_everywhere(
    samples: FlashSamples, found: Found, number: int, allowed: Bools, tilted: bool
) -> Points:
    """The texels of a chunk. allowed: (n, k) the materials of the corners of their faces, of which
    each texel takes the one that fits best; tilted: normals are told by the photos too.
    """
    parts = []
    for piece, part, seen in points_of(samples, found, number):
        points = texels_by_material(part, seen, found, allowed[piece])
        parts.append(tilted_points(part, seen, points, found) if tilted else points)
    return Points(*(np.concatenate([getattr(p, k) for p in parts]) for k in vars(parts[0])))


def texels_by_material(part: Surfel, seen: Observations, found: Found, allowed: Bools) -> Points:
    """Some texels with the normals of the mesh."""
    tried = _tried(part, seen, found)
    cost = tried.cost
    if found.witnesses is not None:
        none = np.zeros_like(cost)
        cost, _ = found.witnesses.judged(cost, tried.told, none, tried.matte)
    label = np.argmin(np.where(allowed, cost, np.inf), axis=1)
    return _chosen(part.xyz, tried, label, np.ones(len(label), np.float32), found)


def tilted_points(part: Surfel, seen: Observations, points: Points, found: Found) -> Points:
    """The same with normals of their own, where the photos tell them; the color of metals stays,
    since it is known from others.
    """
    kinds = np.array([kind.values for kind in found.kinds], np.float32)
    metal = kinds[points.label, 1] > 0.5
    turning = Turning.of(part, seen, found.flashes, found.shadows.center)
    told = tilts(turning, kinds[points.label[seen.point]].T, metal, points.color)
    return replace(points, color=told.color, normal=turning.normals(told.tilt))


def _tried(part: Surfel, seen: Observations, found: Found) -> _Tried:
    terms = [model_terms(seen, kind.values) for kind in found.kinds]
    fits = [fit_terms(seen, *one, CAUCHY_ROUNDS) for one in terms]
    told = np.zeros((len(part.xyz), 2), np.float32)
    if found.witnesses is not None:
        told = found.witnesses.costs(part.xyz, seen, terms)
    return _Tried(
        np.stack([fit.cost for fit in fits], axis=1), told,
        np.stack([fit.color for fit in fits], axis=1),
        fit_lambert(seen).color, seen.number, seen.nearest_highlight(), part.normal,
    )  # fmt: skip


def _chosen(xyz: Floats, tried: _Tried, label: Index, sure: Floats, found: Found) -> Points:
    """Colors by label; metals without a highlight of their own take that of others near."""
    metal = np.array([kind.metal for kind in found.kinds])
    lit = tried.highlight >= HIGHLIGHT
    mirrors = _Mirrors(found, metal)
    metals = np.flatnonzero(metal[label])
    far, color = mirrors.near(xyz[metals], tried.matte[metals])
    far &= ~lit[metals]
    alone = metals[far]
    label = label.copy()
    if len(alone) and not metal.all():
        paints = np.flatnonzero(~metal)
        label[alone] = paints[np.argmin(tried.cost[alone][:, paints], axis=1)]
    out = tried.colors[np.arange(len(label)), label]
    own = np.float32(OWN) * lit[metals, None]
    mixed = own * out[metals] + (1 - own) * color
    out[metals[~far]] = mixed[~far]
    sure = sure * (tried.number / (tried.number + HALF)) * np.where(lit, 1, UNLIT)
    sure[alone] *= 0.5
    return Points(out, label, sure.astype(np.float32), tried.number, tried.normal)


class _Mirrors:
    """Metals that saw their highlight."""

    def __init__(self, found: Found, metal: Any) -> None:
        lit = found.seen.nearest_highlight() >= HIGHLIGHT
        rows = np.flatnonzero(lit & metal[found.label] & (found.seen.number >= 3))
        self._color, self._diagonal = found.flat_color[rows], found.diagonal
        self._place = MIRRORED * found.diagonal
        self._matte = fit_lambert(found.seen).color
        self._places, self._count = cKDTree(found.surfels.xyz[rows]), min(MIRRORS, len(rows))
        like = place_and_chroma(found.surfels.xyz[rows], self._matte[rows], self._place)
        self._alike = cKDTree(like)

    def near(self, xyz: Floats, matte: Floats) -> tuple[Bools, Floats]:
        """(n,) whether points are far from all lit metal, and (n, 3) the color of that near; matte:
        (n, 3) what they look like.
        """
        if not self._count or not len(xyz):
            return np.ones(len(xyz), bool), np.zeros((len(xyz), 3), np.float32)
        away = self._places.query(xyz, workers=-1)[0]
        like = place_and_chroma(xyz, matte, self._place)
        near = self._alike.query(like, self._count, workers=-1)[1].reshape(-1, self._count)
        color = np.median(self._color[near], axis=1).astype(np.float32)
        return away > FARTHEST * self._diagonal, color
