"""What the photos show of points under the flash, one row an observation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.by_point import ByPoint
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.reflection import Angles
from texproj.arrays import Bools, Doubles, Floats, Index
from texproj.camera import Camera
from texproj.render.rays import RayCaster

LEAST_NV, LEAST_NL = 0.15, 0.1
"""Cosines to the eye and to the lamp below which an observation tells nothing: edges, shadows."""

CLIPPED = 0.93
"""Linear light (sRGB .97) from which on a channel is cut: what was there is brighter than that."""

LEAST_TRUST = 0.05
"""Of the picture: nearer to an edge of the mesh, or to a mask, other things are seen too."""

LEAN, BESIDE = 4, 2
"""Sound samples from which on edges are not looked at, and how many of those tell a color where
there is nothing else: too few to tell a material.
"""

READ_NOISE, SHOT_NOISE, MODEL_ERROR = 0.003, 7e-5, 0.01
"""Of linear light y: variance is READ_NOISE^2 + SHOT_NOISE y + (MODEL_ERROR y)^2. A model error of
a tenth would drown the highlights, which are the information."""


@dataclass(frozen=True, eq=False)
class Flashes:
    """The photos as flashes. eye, lamp, axis: (p, 3) world positions and unit axes; gain: (p,) each
    flash's output, geometric mean 1; orientation of the photos is in them.
    """

    cameras: tuple[Camera, ...]
    eye: Doubles
    place: Doubles
    axis: Doubles
    gain: Floats

    @classmethod
    def of(cls, cameras: Sequence[Camera], lamp: Lamp, orientations: Sequence[int]) -> Flashes:
        """All of the same output."""
        lamps = [lamp.in_world(c, o) for c, o in zip(cameras, orientations, strict=True)]
        place, axis = (np.stack(x) for x in zip(*lamps, strict=True))
        eye = np.stack([camera.center for camera in cameras])
        return cls(tuple(cameras), eye, place, axis, np.ones(len(cameras), np.float32))

    def with_gain(self, gain: Floats) -> Flashes:
        return replace(self, gain=gain.astype(np.float32))


@dataclass(frozen=True, eq=False)
class Surfel:
    """n points: xyz (n, 3) float32 relative to the mesh's center, normal (n, 3) unit."""

    xyz: Floats
    normal: Floats


@dataclass(frozen=True, eq=False)
class Observations(ByPoint):
    """m observations of `count` points, ordered by point.

    point, photo: (m,) numbers; rgb: (m, 3) linear; light: (m,) irradiance of the flash; angles:
    their cosines; trust: (m,) what the picture is worth there times the cosine to the eye; around:
    (m, 3) irradiance from the surface around, of the same flash; cut: (m, 3) where rgb is only the
    least that there was.
    """

    photo: Index
    rgb: Floats
    light: Floats
    angles: Angles
    trust: Floats
    around: Floats
    cut: Bools

    @cached_property
    def inverse_variance(self) -> Floats:
        """(m, 3) 1 over the variance of each channel."""
        y = np.maximum(self.rgb, 0)
        noise = np.float32(READ_NOISE**2) + np.float32(SHOT_NOISE) * y
        return np.reciprocal(noise + np.square(np.float32(MODEL_ERROR) * y), dtype=np.float32)

    @cached_property
    def precision(self) -> Floats:
        """(m, 3) weights."""
        return self.inverse_variance * self.trust[:, None]

    @classmethod
    def joined(cls, parts: Sequence[Observations]) -> Observations:
        """One after the other, points numbered on."""
        starts = np.cumsum([0, *(part.count for part in parts)])
        a = [part.angles for part in parts]
        angles = Angles(*(np.concatenate([getattr(x, k) for x in a]) for k in Angles.NAMES))
        point = np.concatenate([p.point + s for p, s in zip(parts, starts[:-1], strict=True)])
        photo, rgb, light, trust, around, cut = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("photo", "rgb", "light", "trust", "around", "cut")
        )
        return cls(int(starts[-1]), point, photo, rgb, light, angles, trust, around, cut)

    def nearest_highlight(self) -> Floats:
        """(count,) largest cosine of normal and half vector, 0 without an observation."""
        out = np.zeros(self.count, np.float32)
        np.maximum.at(out, self.point, self.angles.nh)
        return out

    def kept(self, rows: Bools) -> Observations:
        """Some of the observations, of all points."""
        a = self.angles
        return Observations(
            self.count, self.point[rows], self.photo[rows], self.rgb[rows], self.light[rows],
            Angles(a.nl[rows], a.nv[rows], a.nh[rows], a.vh[rows]), self.trust[rows],
            self.around[rows], self.cut[rows],
        )  # fmt: skip

    def of_points(self, chosen: Index) -> Observations:
        """All of some points, which are numbered anew; chosen: (k,) rising."""
        new = np.full(self.count, -1)
        new[chosen] = np.arange(len(chosen))
        part = self.kept(new[self.point] >= 0)
        return replace(part, count=len(chosen), point=new[part.point])

    def scaled(self, factor: Floats) -> Observations:
        """Under light times a factor (m,)."""
        around = self.around * factor[:, None]
        return replace(self, light=self.light * factor, around=around)


@dataclass(frozen=True, eq=False)
class Shown:
    """What p photos show of n points. photos: (p,) their numbers; rgb: (p, 3, n) linear light;
    weight: (p, n), 0 where they do not see them; cut: (p, 3, n) where there was more light than
    they could hold.
    """

    photos: Index
    rgb: Floats
    weight: Floats
    cut: Bools

    def of_points(self, chosen: Index) -> Shown:
        """Some of the points."""
        return Shown(
            self.photos, self.rgb[:, :, chosen], self.weight[:, chosen], self.cut[:, :, chosen]
        )


def observe(
    surfels: Surfel, shown: Shown, flashes: Flashes, lamp: Lamp, caster: LampShadows
) -> Observations:
    """What photos say of points, under an intensity of 1 where the lamp's is unknown. What is
    beside an edge counts only for points that are seen nowhere else.
    """
    sound = shown.weight > LEAST_TRUST
    lean = np.count_nonzero(sound, axis=0) < LEAN
    point, row = np.nonzero((sound | (lean & (shown.weight > 0))).T)
    photo, cut = shown.photos[row], shown.cut[row, :, point]
    rgb, trust = shown.rgb[row, :, point], shown.weight[row, point]
    xyz, normal = surfels.xyz[point], surfels.normal[point]
    to_eye, _ = unit((flashes.eye - caster.center).astype(np.float32)[photo] - xyz)
    to_lamp, distance = unit((flashes.place - caster.center).astype(np.float32)[photo] - xyz)
    nl, nv = dots(normal, to_lamp), dots(normal, to_eye)
    good = (nl > LEAST_NL) & (nv > LEAST_NV)
    kept = np.flatnonzero(good)
    kept = kept[caster.lit(xyz[kept], normal[kept], to_lamp[kept], distance[kept])]
    kept = kept[_better(point[kept], trust[kept] > LEAST_TRUST, nv[kept])]
    point, photo, rgb, xyz = point[kept], photo[kept], rgb[kept], xyz[kept]
    cut = cut[kept]
    nl, nv, to_lamp = nl[kept], nv[kept], to_lamp[kept]
    half, _ = unit(to_lamp + to_eye[kept])
    cosine = -dots(to_lamp, flashes.axis.astype(np.float32)[photo])
    light = lamp.strength(cosine) * flashes.gain[photo]
    light *= nl / np.square(distance[kept])
    light *= np.float32(1 if lamp.intensity is None else lamp.intensity)
    nh, vh = dots(surfels.normal[point], half), dots(to_eye[kept], half)
    through = _falloff(xyz + caster.center, photo, flashes, lamp)
    rgb = np.divide(rgb, np.maximum(through, 1e-3)[:, None], dtype=np.float32)
    seen = Observations(
        len(surfels.xyz), point, photo, rgb, light, Angles(nl, nv, nh, vh), trust[kept] * nv,
        np.zeros((len(point), 3), np.float32), cut,
    )  # fmt: skip
    return seen if lamp.bare else seen.kept((light > 0) & (through > 0))


def _better(point: Index, sound: Bools, nv: Floats) -> Index:
    """Rows (of m by rising points) that are sound, and of points without any the `BESIDE` that see
    them most squarely.
    """
    rows = np.flatnonzero(~np.isin(point, point[sound]))
    rows = rows[np.lexsort((-nv[rows], point[rows]))]
    starts = np.searchsorted(point[rows], point[rows])
    few = rows[np.arange(len(rows)) - starts < BESIDE]
    return np.sort(np.concatenate([np.flatnonzero(sound), few]))


def _falloff(xyz: NDArray[Any], photo: Index, flashes: Flashes, lamp: Lamp) -> Floats:
    """(m,) what the lens lets through where each observation lies in its photo."""
    out = np.ones(len(photo), np.float32)
    if not lamp.vignetting:
        return out
    for number, camera in enumerate(flashes.cameras):
        rows = np.flatnonzero(photo == number)
        out[rows] = lamp.falloff(camera, camera.project(xyz[rows])[0])
    return out


class LampShadows:
    """Which points of a mesh a lamp lights. center: (3,) that of the mesh, which points count from;
    caster: of the mesh around it; lift: how far rays start above the surface.
    """

    def __init__(self, caster: RayCaster, center: Doubles, lift: float) -> None:
        self.caster, self.center, self.lift = caster, center, np.float32(lift)

    def lit(self, xyz: Floats, normal: Floats, to_lamp: Floats, distance: Floats) -> Bools:
        """(n,) whether nothing stands between points and lamps in directions at distances."""
        return ~self.caster.blocked(xyz + self.lift * normal, to_lamp, distance)


def unit(vectors: Floats) -> tuple[Floats, Floats]:
    """(n, 3) unit vectors and (n,) lengths."""
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return vectors / np.maximum(length, np.float32(1e-30))[:, None], length


def dots(a: Floats, b: Floats) -> Floats:
    """(n,) inner products."""
    return np.einsum("ij,ij->i", a, b)
