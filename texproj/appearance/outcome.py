"""What finding an appearance hands over."""

from __future__ import annotations

from dataclasses import dataclass

from texproj.appearance.verdict import Verdict
from texproj.arrays import Doubles, Floats


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
class Appearance:
    """The surface itself, at the vertices of the mesh.

    base: (V, 3) float32 linear base color in 0..1, the blended colors where the light was refused;
    irradiance: (V, 3) float32 that was divided out, over pi, None where it was refused;
    confidence: (V,) float32 in 0..1, 0 = unseen; light: None where none was found; accepted:
    whether the light is believed, reason: why not, one sentence with the next step; absolute:
    base colors are reflectances, not only up to one factor; verdict: by what it was judged.
    """

    base: Floats
    irradiance: Floats | None
    confidence: Floats
    light: NaturalLight | None
    accepted: bool
    reason: str
    absolute: bool
    verdict: Verdict | None
