"""What finding an appearance hands over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.appearance.flash.found import Found
from texproj.appearance.flash.held_out import FlashVerdict
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.pooled import Pooled
from texproj.appearance.polarized.pair_verdict import PairVerdict
from texproj.appearance.turntable.lamps import RoomLamp
from texproj.appearance.turntable.room_verdict import RoomVerdict
from texproj.appearance.verdict import Verdict
from texproj.arrays import Doubles, Floats, Index

MATTE = np.float32(1)
"""Roughness where nothing tells it."""


@dataclass(frozen=True, eq=False)
class NaturalLight:
    """The light of the day, world axes; radiance in the unit of the blended colors over that of
    the base colors, so that ``color = base / pi * irradiance``.

    sky: (9, 3) radiance by spherical harmonics (`harmonics.basis`); to_sun: (3,) unit vector
    towards the sun and sun: (3,) irradiance square to it, or None where there is none.
    """

    sky: Doubles
    to_sun: Doubles | None = None
    sun: Doubles | None = None


@dataclass(frozen=True, eq=False)
class DaysLight:
    """The light of several days, by their names."""

    days: dict[str, NaturalLight]


@dataclass(frozen=True, eq=False)
class FlashLight:
    """A flash on the camera. found: the materials, the lamp with its intensity and the output of
    each flash, by the photos' numbers; names: of the photos; label: (V,) material of each vertex.
    """

    found: Found
    names: tuple[str, ...]
    label: Index

    @property
    def output(self) -> dict[str, float]:
        """Of each flash, 1 on the whole."""
        gains = self.found.flashes.gain
        return {name: float(gain) for name, gain in zip(self.names, gains, strict=True)}


@dataclass(frozen=True, eq=False)
class TurntableLight:
    """Light that stood still while the object was turned, axes of the room (`turntable.Room`); unit
    as that of `NaturalLight`.

    sky: (9, 3) radiance by spherical harmonics; lamps: and strength (k, 3), the irradiance by each
    square to it; exposure: of each photo against the others.
    """

    sky: Doubles
    lamps: tuple[RoomLamp, ...]
    strength: Doubles
    exposure: dict[str, float]


@dataclass(frozen=True, eq=False)
class PolarizedLight:
    """A flash through a polarizer. kinds: each paint's roughness and mirror; label: (V,) the paint
    of each vertex; output: of each flash.
    """

    lamp: Lamp
    kinds: tuple[Pooled, ...]
    label: Index
    output: dict[str, float]


@dataclass(frozen=True, eq=False)
class Appearance:
    """The surface itself, at the vertices of the mesh.

    base: (V, 3) float32 linear base color in 0..1, the blended colors where the light was refused;
    roughness, metallic: (V,) float32 in 0..1, `MATTE` and 0 where nothing tells them;
    irradiance: (V, 3) float32 that was divided out, over pi, None where there is no natural light;
    confidence: (V,) float32 in 0..1, 0 = unseen; light: None where none was found; accepted:
    whether the light is believed, reason: why not, one sentence with the next step; absolute:
    base colors are reflectances, not only up to one factor; verdict: by what it was judged;
    mirrored: (V,) float32 what photos of two polarizations say is mirrored: at normal incidence
    under a flash, 0 where it is not known; else the part of all light, on the mean over the photos.
    """

    base: Floats
    roughness: Floats
    metallic: Floats
    irradiance: Floats | None
    confidence: Floats
    light: NaturalLight | DaysLight | FlashLight | TurntableLight | PolarizedLight | None
    accepted: bool
    reason: str
    absolute: bool
    verdict: Verdict | FlashVerdict | RoomVerdict | PairVerdict | None
    mirrored: Floats | None = None


def untold(points: int) -> tuple[Floats, Floats]:
    """(n,) roughness and (n,) metallic of points of which nothing tells them."""
    return np.full(points, MATTE), np.zeros(points, np.float32)
