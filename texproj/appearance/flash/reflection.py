"""What a candidate material reflects of a flash: linear in its color, so that the color is found
in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texproj.arrays import Floats

DIELECTRIC = 0.04
"""Mean reflection of a dielectric at normal incidence: an index of 1.5."""


@dataclass(frozen=True)
class Material:
    """roughness in 0..1 (alpha is its square); metal: the color is that of the mirror, else that of
    the matte part; f0: mirror of a dielectric at normal incidence.
    """

    roughness: float
    metal: bool
    f0: float = DIELECTRIC


ROUGHNESSES = tuple(float(r) for r in np.linspace(0.15, 0.95, 17))
ROUGHEST_METAL = 0.65
"""Rougher metals look matte: no photo tells them from paint."""

CANDIDATES = tuple(Material(r, False) for r in ROUGHNESSES) + tuple(
    Material(r, True) for r in ROUGHNESSES if r <= ROUGHEST_METAL
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


def linear_terms(
    roughness: float | Floats, metal: bool | Floats, f0: float | Floats, angles: Angles
) -> tuple[Floats, Floats]:
    """(n,) slope and (n,) offset of the reflectance, without the cosine, in the color.

    Dielectric: color / pi + s (f0 + (1 - f0)(1 - vh)^5); metal: s (color + (1 - color)(1 - vh)^5),
    by Schlick. Material values may be one or (n,), metal then 0 or 1.
    """
    s = lobe(roughness, angles)
    edge = np.square(np.square(1 - angles.vh)) * (1 - angles.vh)
    of_metal = s * (1 - edge), s * edge
    of_paint = np.float32(1 / np.pi), s * (f0 + (1 - f0) * edge)
    if isinstance(metal, bool):
        return of_metal if metal else (np.full_like(s, of_paint[0]), of_paint[1])
    slope = metal * of_metal[0] + (1 - metal) * of_paint[0]
    return slope, metal * of_metal[1] + (1 - metal) * of_paint[1]
