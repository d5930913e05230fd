"""Normals of the surface from its photos under the flash, where those of the mesh are not its own.

The color and the tilt of a point are fitted together to all that was seen of it, by the material
that it is of. Woodham, "Photometric method for determining surface orientation from multiple
images", Optical Engineering 19(1), 1980, for lights that move with the camera and surfaces that
mirror.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texproj.appearance.flash.closed_form import (
    CAUCHY,
    CAUCHY_ROUNDS,
    Fit,
    fit_terms,
    misfit,
    model_terms,
)
from texproj.appearance.flash.observations import Flashes, Observations, Surfel, dots, unit
from texproj.appearance.flash.reflection import Angles
from texproj.arrays import Bools, Doubles, Floats
from texproj.render.directions import tangents

ROUNDS = 4
SPREAD = 0.1
"""Tangent of the angle by which normals are taken to be off, one standard deviation."""

STEP = np.float32(2e-3)
"""Of differences: what single precision still tells."""

MOST = np.float32(0.6)
"""Tangent of the largest tilt, 31 degrees: beyond it the mesh lacks more than a normal."""

GRAZING = np.float32(0.05)
"""Cosine to eye and lamp that a tilted point has at least, since it was seen and lit."""

LEAST_DROP, LEAST_FALL = 0.25, 0.05
"""Part by which the cost of a point has to fall for its tilt to be believed, and by how much at
least: noise has a cost of .5."""

ENOUGH = 5
"""Observations that tell a tilt: fewer fit color and tilt whatever they show."""


@dataclass(frozen=True, eq=False)
class Turning:
    """Points that can be tilted, and what was seen of them.

    seen: by the normals of the mesh; normal, right, along: (n, 3) axes of the points; to_eye,
    to_lamp: (m, 3) unit; square: (m,) irradiance square to the lamp.
    """

    seen: Observations
    normal: Floats
    right: Floats
    along: Floats
    to_eye: Floats
    to_lamp: Floats
    square: Floats

    @classmethod
    def of(cls, surfels: Surfel, seen: Observations, flashes: Flashes, center: Doubles) -> Turning:
        """center: (3,) that of the mesh, which points count from."""
        xyz = surfels.xyz[seen.point]
        to_eye, _ = unit((flashes.eye - center).astype(np.float32)[seen.photo] - xyz)
        to_lamp, _ = unit((flashes.place - center).astype(np.float32)[seen.photo] - xyz)
        square = seen.light / seen.angles.nl
        return cls(
            seen, surfels.normal, *tangents(surfels.normal), to_eye, to_lamp, square
        )  # fmt: skip

    def normals(self, tilt: Floats) -> Floats:
        """(n, 3) unit normals tilted by (n, 2), tangents of angles."""
        return unit(self.normal + tilt[:, :1] * self.right + tilt[:, 1:] * self.along)[0]

    def at(self, tilt: Floats) -> Observations:
        """The observations of points tilted by (n, 2)."""
        return self.facing(self.normals(tilt))

    def facing(self, normals: Floats) -> Observations:
        """The observations of points of normals (n, 3)."""
        normal = normals[self.seen.point]
        half, _ = unit(self.to_lamp + self.to_eye)
        nl = np.maximum(dots(normal, self.to_lamp), GRAZING)
        nv = np.maximum(dots(normal, self.to_eye), GRAZING)
        angles = Angles(nl, nv, np.clip(dots(normal, half), 0, 1), self.seen.angles.vh)
        return replace(self.seen, light=self.square * nl, angles=angles)


@dataclass(frozen=True, eq=False)
class Tilts:
    """tilt: (n, 2), 0 where it is not believed; color: (n, 3) with it; believed: (n,)."""

    tilt: Floats
    color: Floats
    believed: Bools


def tilts(turning: Turning, values: Floats, held: Bools, color: Floats) -> Tilts:
    """The tilt of each point for its material, by Gauss and Newton with colors eliminated.

    values: (4, m) of each observation's material; held: (n,) points whose color (n, 3) is known
    and stays.
    """
    seen = turning.seen
    tilt = np.zeros((seen.count, 2), np.float32)

    def fitted(here: Observations, rounds: int) -> Fit:
        slope, offset = model_terms(here, values)
        free = fit_terms(here, slope, offset, rounds)
        kept = np.where(held[:, None], color, free.color)
        return Fit(kept, np.where(held, misfit(here, slope, offset, kept), free.cost))

    plain = best = fitted(seen, CAUCHY_ROUNDS)
    for _ in range(ROUNDS):
        new = tilt + _step(turning, values, tilt, best.color, ~held)
        size = np.linalg.norm(new, axis=1, keepdims=True)
        new = (new * np.minimum(1, MOST / np.maximum(size, np.float32(1e-9)))).astype(np.float32)
        trial = fitted(turning.at(new), 2)
        better = trial.cost < best.cost
        tilt = np.where(better[:, None], new, tilt)
        best = Fit(
            np.where(better[:, None], trial.color, best.color),
            np.where(better, trial.cost, best.cost),
        )
    limit = np.minimum((1 - LEAST_DROP) * plain.cost, plain.cost - LEAST_FALL)
    believed = (seen.number >= ENOUGH) & (best.cost < limit)
    where = believed[:, None]
    return Tilts(np.where(where, tilt, 0), np.where(where, best.color, plain.color), believed)


def _step(turning: Turning, values: Floats, tilt: Floats, color: Floats, free: Bools) -> Floats:
    """(n, 2) by which the tilts change. free: (n,) points whose color gives way."""
    seen = turning.seen
    slope, offset = model_terms(turning.at(tilt), values)
    told = slope * color[seen.point] + offset
    off = seen.rgb - told
    off *= ~(seen.cut & (off < 0))
    square = np.einsum("ij,ij,ij->i", off, off, seen.inverse_variance) / 3
    weight = seen.precision * (1 / (1 + square / np.float32(CAUCHY**2)))[:, None]
    change = []
    for axis in np.eye(2, dtype=np.float32) * STEP:
        aside, more = model_terms(turning.at(tilt + axis), values)
        change.append((aside * color[seen.point] + more - told) / STEP)
    give = free[:, None] / (seen.sums(weight * slope * slope) + np.float32(1e-12))
    by_color = seen.sums(weight * slope * off)
    mixed = [seen.sums(weight * one * slope) for one in change]
    matrix, vector = np.empty((seen.count, 2, 2)), np.empty((seen.count, 2, 1))
    for a in range(2):
        along = weight * change[a]
        pull = seen.sums((along * off).sum(axis=1, keepdims=True))[:, 0]
        vector[:, a, 0] = pull - (mixed[a] * by_color * give).sum(axis=1) - tilt[:, a] / SPREAD**2
        for b in range(2):
            both = seen.sums((along * change[b]).sum(axis=1, keepdims=True))[:, 0]
            matrix[:, a, b] = both - (mixed[a] * mixed[b] * give).sum(axis=1)
        matrix[:, a, a] += 1 / SPREAD**2
    out: Floats = np.linalg.solve(matrix, vector)[..., 0].astype(np.float32)
    return out
