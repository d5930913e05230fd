"""Light of the flash that comes to points from the surface around them: one bounce."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.observations import Flashes, LampShadows, Surfel, dots, unit
from texproj.appearance.flash.reflection import Angles, Material, linear_terms
from texproj.arrays import Bools, Floats, Index
from texproj.render.directions import cosine_directions

RAYS = 48
FURTHER = 2
"""Bounces after the first: in hollows they are a tenth of the light."""

NEAREST = 4
"""Nodes that light is interpolated between."""

CHUNK = 1 << 19


@dataclass(frozen=True, eq=False)
class Nodes:
    """Points of known material all over the surface. color: (n, 3); label: (n,) into materials."""

    surfels: Surfel
    color: Floats
    label: Index
    materials: Sequence[Material]


@dataclass(frozen=True, eq=False)
class Hits:
    """Rays from points that meet the surface: node (h,) they come from, the node that stands for
    what they meet (h,), where (h, 3), the direction (h, 3) back, and the normal (h, 3) there.
    """

    node: Index
    met: Index
    xyz: Floats
    back: Floats
    normal: Floats


def surface_hits(shadows: LampShadows, surfels: Surfel, nodes: Surfel | None = None) -> Hits:
    """What cosine-distributed rays from points meet, and the nodes that stand for it: the points
    themselves by default.
    """
    nodes = surfels if nodes is None else nodes
    shifts = np.random.default_rng(0).random((len(surfels.xyz), 2), np.float32)
    tree = cKDTree(nodes.xyz)
    parts = []
    step = max(1, CHUNK // RAYS)
    for start in range(0, len(surfels.xyz), step):
        part = slice(start, start + step)
        directions = cosine_directions(surfels.normal[part], shifts[part], RAYS).reshape(-1, 3)
        origins = surfels.xyz[part] + shadows.lift * surfels.normal[part]
        origins = np.repeat(origins, RAYS, 0)
        hits = shadows.caster.first(origins, directions)
        rows = np.flatnonzero(hits.face >= 0)
        where = origins[rows] + directions[rows] * hits.depth[rows, None]
        parts.append((start + rows // RAYS, where, -directions[rows]))
    node, where, back = (np.concatenate(x) for x in zip(*parts, strict=True))
    met = tree.query(where, workers=-1)[1] if len(where) else np.zeros(0, np.intp)
    front = dots(nodes.normal[met], back) > 0.05
    node, met, where, back = node[front], met[front], where[front], back[front]
    return Hits(node, met, where, back, nodes.normal[met])


def bounced(
    nodes: Nodes, hits: Hits, flashes: Flashes, lamp: Lamp, shadows: LampShadows, seen: Bools
) -> Floats:
    """(n, p, 3) irradiance at nodes from the surface around, for each flash.

    seen: (n, p) where it is asked for. What is met reflects the flash by its own material towards
    the node; further bounces, between points where it is asked for, are taken for matte.
    """
    out = np.zeros((*seen.shape, 3), np.float32)
    values = np.array([material.values for material in nodes.materials], np.float32)
    part = np.full(len(hits.node), 1 / RAYS, np.float32)
    met = csr_array((part, (hits.node, hits.met)), shape=(len(out), len(out)))
    for photo in range(seen.shape[1]):
        rows = np.flatnonzero(seen[hits.node, photo])
        place = (flashes.place[photo] - shadows.center).astype(np.float32)
        to_lamp, distance = unit(place - hits.xyz[rows])
        normal, back = hits.normal[rows], hits.back[rows]
        nl = dots(normal, to_lamp)
        lit = np.flatnonzero(nl > 0.02)
        lit = lit[shadows.lit(hits.xyz[rows[lit]], normal[lit], to_lamp[lit], distance[lit])]
        rows, to_lamp, distance, nl = rows[lit], to_lamp[lit], distance[lit], nl[lit]
        normal, back = normal[lit], back[lit]
        half, _ = unit(to_lamp + back)
        angles = Angles(nl, dots(normal, back), dots(normal, half), dots(back, half))
        slope, offset = linear_terms(values[nodes.label[hits.met[rows]]].T, angles)
        cosine = -to_lamp @ flashes.axis[photo].astype(np.float32)
        light = lamp.strength(cosine) * nl / np.square(distance) * flashes.gain[photo]
        light *= np.float32(np.pi / RAYS * (1 if lamp.intensity is None else lamp.intensity))
        sent = (light * slope)[:, None] * nodes.color[hits.met[rows]] + (light * offset)[:, None]
        for channel in range(3):
            out[:, photo, channel] = np.bincount(hits.node[rows], sent[:, channel], len(out))
        out[:, photo] = _onward(out[:, photo], nodes.color, met)
    return out


def _onward(first: Floats, color: Floats, met: Any) -> Floats:
    """(n, 3) the first bounce and those after it. met: (n, n) parts of what nodes meet."""
    out = first
    for _ in range(FURTHER):
        out = first + met @ (color * out)
    return out


class BounceField:
    """The bounce anywhere on the surface, between nodes."""

    def __init__(self, surfels: Surfel, around: Floats) -> None:
        """around: (n, p, 3) at the nodes."""
        self._tree, self._normal = cKDTree(surfels.xyz), surfels.normal
        self._around = around

    def at(self, surfels: Surfel, point: Index, photo: Index) -> Floats:
        """(m, 3) at points of surfels, of a flash each."""
        count = min(NEAREST, len(self._normal))
        far, near = self._tree.query(surfels.xyz, count, workers=-1)
        far, near = far.reshape(-1, count), near.reshape(-1, count)
        alike = np.einsum("nkc,nc->nk", self._normal[near], surfels.normal)
        weight = np.maximum(alike, 0.05) ** 4 / (far + 1e-3 * (far.mean() + 1e-12))
        weight = (weight / weight.sum(axis=1, keepdims=True)).astype(np.float32)
        out = np.zeros((len(point), 3), np.float32)
        for k in range(count):
            out += weight[point, k, None] * self._around[near[point, k], photo]
        return out
