"""The color and material of every point, from the few materials that the surface is made of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from texproj.appearance.flash.closed_form import fit_lambert, fit_material
from texproj.appearance.flash.found import HIGHLIGHT, Found
from texproj.appearance.flash.observations import Observations, Surfel, observe
from texproj.appearance.flash.sampled import FlashSamples
from texproj.appearance.flash.voting import mesh_neighbors, settled, smoothed
from texproj.arrays import Bools, Floats, Index
from texproj.mesh import Mesh

MIRRORS = 8
"""Points nearby that saw their highlight, whose mean a metal takes that did not see its own."""

FARTHEST = 0.1
"""Of the diagonal: farther from any metal that was seen to mirror nothing is called one."""

ENOUGH = 2.0
"""Observations at which confidence is half."""

UNLIT = 0.5
"""What is left of it for a point that did not see its highlight: its gloss is that of others."""


@dataclass(frozen=True, eq=False)
class Points:
    """Of n points: color (n, 3), label (n,) into the materials, sure (n,) 0..1, number (n,) of
    observations.
    """

    color: Floats
    label: Index
    sure: Floats
    number: Index

    @property
    def seen(self) -> Bools:
        return self.number > 0


@dataclass(frozen=True, eq=False)
class _Tried:
    """Of n points and k materials: cost (n, k), colors (n, k, 3), matte (n, 3), number and nearest
    highlight (n,).
    """

    cost: Floats
    colors: Floats
    matte: Floats
    number: Index
    highlight: Floats


def points_of(
    samples: FlashSamples, found: Found, number: int
) -> Iterator[tuple[slice, Surfel, Observations]]:
    """The pieces of a chunk, with what the photos say of them."""
    surfel = samples.points.surfel(number)
    for piece in samples.store.pieces(number):
        part = Surfel(surfel.xyz[piece], surfel.normal[piece])
        stack = samples.store.read(number, piece)
        seen = observe(part, stack, found.flashes, found.lamp, samples.shadows)
        around = found.field.at(part, seen.point, seen.photo)
        yield piece, part, replace(seen, around=around)


def vertices_everywhere(
    mesh: Mesh, samples: FlashSamples, found: Found, progress: Callable[[int], None]
) -> Points:
    """All vertices of the mesh. progress: called with the number of vertices that are done."""
    tried, done = [], 0
    for number in range(len(samples.points.sizes)):
        for _, part, seen in points_of(samples, found, number):
            tried.append(_tried(seen, found))
            done += len(part.xyz)
            progress(done)
    whole = _Tried(*(np.concatenate([getattr(t, k) for t in tried]) for k in vars(tried[0])))
    xyz = (mesh.vertices - mesh.center).astype(np.float32)
    near = mesh_neighbors(mesh.faces, len(xyz))
    cost = smoothed(whole.cost, whole.number > 0, near)
    label, sure = settled(cost, found.voters.shares(xyz, whole.matte), near)
    return _chosen(xyz, whole, label, sure, found)


def texels_everywhere(samples: FlashSamples, found: Found, number: int, allowed: Bools) -> Points:
    """The texels of a chunk. allowed: (n, k) the materials of the corners of their faces, of which
    each texel takes the one that fits best.
    """
    parts = []
    for piece, part, seen in points_of(samples, found, number):
        tried = _tried(seen, found)
        cost = np.where(allowed[piece], tried.cost, np.inf)
        label = np.argmin(cost, axis=1)
        parts.append(_chosen(part.xyz, tried, label, np.ones(len(label), np.float32), found))
    return Points(*(np.concatenate([getattr(p, k) for p in parts]) for k in vars(parts[0])))


def _tried(seen: Observations, found: Found) -> _Tried:
    fits = [fit_material(seen, kind) for kind in found.kinds]
    return _Tried(
        np.stack([fit.cost for fit in fits], axis=1),
        np.stack([fit.color for fit in fits], axis=1),
        fit_lambert(seen).color, seen.number, seen.nearest_highlight(),
    )  # fmt: skip


def _chosen(xyz: Floats, tried: _Tried, label: Index, sure: Floats, found: Found) -> Points:
    """Colors by label; metals without a highlight of their own take that of others near."""
    metal = np.array([kind.metal for kind in found.kinds])
    lit = tried.highlight >= HIGHLIGHT
    mirrors = _Mirrors(found, metal)
    wanting = np.flatnonzero(metal[label] & ~lit)
    far, color = mirrors.near(xyz[wanting], label[wanting])
    alone = wanting[far]
    label = label.copy()
    if len(alone) and not metal.all():
        paints = np.flatnonzero(~metal)
        label[alone] = paints[np.argmin(tried.cost[alone][:, paints], axis=1)]
    out = tried.colors[np.arange(len(label)), label]
    out[wanting[~far]] = color[~far]
    sure = sure * (tried.number / (tried.number + ENOUGH)) * np.where(lit, 1, UNLIT)
    sure[alone] *= 0.5
    return Points(out, label, sure.astype(np.float32), tried.number)


class _Mirrors:
    """Metals that saw their highlight."""

    def __init__(self, found: Found, metal: Any) -> None:
        lit = found.seen.nearest_highlight() >= HIGHLIGHT
        self._limit = FARTHEST * found.diagonal
        self._known = {}
        for number in np.flatnonzero(metal):
            rows = np.flatnonzero(lit & (found.label == number) & (found.seen.number >= 3))
            if len(rows):
                self._known[int(number)] = cKDTree(found.surfels.xyz[rows]), found.fit.color[rows]

    def near(self, xyz: Floats, label: Index) -> tuple[Bools, Floats]:
        """(n,) whether points are far from all of their material, and (n, 3) the color near."""
        far, color = np.ones(len(xyz), bool), np.zeros((len(xyz), 3), np.float32)
        for number, (tree, known) in self._known.items():
            rows = np.flatnonzero(label == number)
            if not len(rows):
                continue
            count = min(MIRRORS, tree.n)
            away, near = tree.query(xyz[rows], count, workers=-1)
            away, near = away.reshape(-1, count), near.reshape(-1, count)
            far[rows] = away[:, 0] > self._limit
            color[rows] = np.median(known[near], axis=1)
        return far, color
