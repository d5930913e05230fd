"""What a candidate material reflects of a flash: linear in its color, so that the color is found
in closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texproj.arrays import Floats

DIELECTRIC = 0.04
"""Mean reflection of a dielectric at normal incidence: an index of 1.5."""


@dataclass(frozen=True)
class Material:
    """roughness in 0..1 (alpha is its square); metal: the color is that of the mirror, else that of
    the matte part; f0: mirror of a dielectric at normal incidence; edge: how bright its matte part
    is in grazing light that goes straight back, against Lambert's, None as is usual for its
    roughness (`usual_edge`).
    """

    roughness: float
    metal: bool
    f0: float = DIELECTRIC
    edge: float | None = None

    @property
    def sharpness(self) -> float:
        """What it costs to be chosen, see `SHARP`."""
        return SHARP * (1 - self.roughness)

    @property
    def values(self) -> tuple[float, float, float, float]:
        """All four as numbers."""
        edge = usual_edge(self.roughness) if self.edge is None else self.edge
        return self.roughness, float(self.metal), self.f0, edge


def usual_edge(roughness: float) -> float:
    """What measured materials do: rough ones are brighter at edges, smooth ones darker. Burley,
    "Physically-based shading at Disney", 2012, sec. 5.3, in light that goes straight back.
    """
    return 0.5 + 2 * roughness


ROUGHNESSES = tuple(float(r) for r in np.linspace(0.15, 0.95, 17))
ROUGHEST_METAL = 0.65
"""Rougher metals look matte: no photo tells them from paint."""

SHARP = 0.06
"""What the cost of a material is more for roughness 0 than for 1 where materials are chosen: a
needle of a highlight that no photo met explains them as well as none at all, and would glare in
another light.
"""

PLAIN_EDGE = tuple(Material(r, False, edge=1.0) for r in (0.6, 0.7, 0.8, 0.9))
"""Rough paint that follows Lambert: else a smooth one that hides its highlight comes nearest."""

CANDIDATES = (
    *(Material(r, False) for r in ROUGHNESSES),
    *PLAIN_EDGE,
    *(Material(r, True) for r in ROUGHNESSES if r <= ROUGHEST_METAL),
)


@dataclass(frozen=True, eq=False)
class Angles:
    """Cosines of n observations, (n,) float32 each: normal to light, normal to eye, normal to the
    half vector, eye to the half vector.
    """

    NAMES: ClassVar = ("nl", "nv", "nh", "vh")
    nl: Floats
    nv: Floats
    nh: Floats
    vh: Floats


def lobe(roughness: float | Floats, angles: Angles) -> Floats:
    """(n,) D V of GGX with height-correlated Smith shadowing: mirror per F, without the cosine.

    Walter et al., EGSR 2007, eq. 33; Heitz, JCGT 3(2), 2014, eq. 99.
    """
    a2 = np.square(np.square(np.asarray(roughness, np.float32)))
    nl, nv, nh = angles.nl, angles.nv, angles.nh
    spread = nh * nh * (a2 - 1) + 1
    d = a2 / (np.float32(np.pi) * spread * spread)
    hidden = nl * np.sqrt(nv * nv * (1 - a2) + a2) + nv * np.sqrt(nl * nl * (1 - a2) + a2)
    return d * np.float32(0.5) / hidden


def linear_terms(values: Sequence[float] | Floats, angles: Angles) -> tuple[Floats, Floats]:
    """(n,) slope and (n,) offset of the reflectance, without the cosine, in the color.

    values: those of one `Material`, or (n,) of each. Dielectric: color / pi e + s (f0 + (1 - f0)
    (1 - vh)^5) with Burley's e of the edge (ibid.); metal: s (color + (1 - color)(1 - vh)^5), by
    Schlick.
    """
    roughness, metal, f0, edge = values
    s = lobe(roughness, angles)
    rise = _fifth(1 - angles.vh)
    more = np.float32(1) * edge - 1
    matte = (1 + more * _fifth(1 - angles.nl)) * (1 + more * _fifth(1 - angles.nv))
    slope = metal * s * (1 - rise) + (1 - metal) * matte * np.float32(1 / np.pi)
    offset = s * (metal * rise + (1 - metal) * (f0 + (1 - f0) * rise))
    return slope.astype(np.float32), offset.astype(np.float32)


def _fifth(x: Floats) -> Floats:
    square = x * x
    return square * square * x
