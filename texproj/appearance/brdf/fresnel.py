"""What a facet mirrors of unpolarized light: F."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from texproj.appearance.brdf.model import Color
from texproj.arrays import Doubles

Fresnel = Callable[[Doubles], Doubles]
"""(n,) cosines to the facet's normal -> (n,) or (n, c) mirrored parts, 0..1."""


def f0_of_ior(ior: Color) -> Color:
    """What is mirrored at normal incidence from outside of a dielectric: 0.04 at 1.5."""
    return ((ior - 1) / (ior + 1)) ** 2


def ior_of_f0(f0: Color) -> Color:
    """The index of refraction that mirrors so much at normal incidence."""
    root = np.sqrt(f0)
    return (1 + root) / (1 - root)


@dataclass(frozen=True, eq=False)
class Schlick:
    """Schlick 1994: F0 + (F90 - F0) (1 - cosine)^5."""

    f0: Color
    f90: Color = 1.0

    def __call__(self, cosine: Doubles) -> Doubles:
        rise = np.clip(1 - cosine, 0, 1) ** 5
        return np.multiply.outer(rise, np.subtract(self.f90, self.f0)) + self.f0


@dataclass(frozen=True, eq=False)
class CookTorrance:
    """Fresnel's equation by way of F0 (Cook and Torrance 1982, sec. 3): that of the dielectric
    which mirrors so much at normal incidence.
    """

    f0: float

    def __call__(self, cosine: Doubles) -> Doubles:
        c = np.clip(cosine, 0, 1)
        g = np.sqrt(float(ior_of_f0(min(self.f0, 0.9999))) ** 2 + c**2 - 1)
        first = ((g - c) / (g + c)) ** 2
        return 0.5 * first * (1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2)


@dataclass(frozen=True, eq=False)
class Dielectric:
    """Fresnel's equations. ior: index of refraction of where the light would go over that of where
    it comes from; below 1 light is mirrored totally from the critical angle on.
    """

    ior: float

    def __call__(self, cosine: Doubles) -> Doubles:
        c = np.clip(cosine, 0, 1)
        inside = 1 - (1 - c**2) / self.ior**2
        t = np.sqrt(np.maximum(inside, 0))
        across = ((c - self.ior * t) / (c + self.ior * t)) ** 2
        along = ((self.ior * c - t) / (self.ior * c + t)) ** 2
        return np.where(inside > 0, (across + along) / 2, 1.0)


@dataclass(frozen=True, eq=False)
class Conductor:
    """Fresnel's equations for a complex index eta + i k, each a number or (c,)."""

    eta: Color
    k: Color

    def __call__(self, cosine: Doubles) -> Doubles:
        c = np.clip(cosine, 0, 1)
        index = np.asarray(self.eta) + 1j * np.asarray(self.k)
        sine2 = np.multiply.outer(1 - c**2, 1 / index**2)
        t = np.sqrt(1 - sine2)
        shape = c.reshape(c.shape + (1,) * (t.ndim - 1))
        across = np.abs((shape - index * t) / (shape + index * t)) ** 2
        along = np.abs((index * shape - t) / (index * shape + t)) ** 2
        return np.asarray((across + along) / 2)
