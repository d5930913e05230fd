"""How microfacets hide each other from the light and from the eye: G, a factor in 0..1.

The list is that of B. Karis, "Specular BRDF reference", 2013. All are symmetric in both directions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import erf

from texproj.appearance.brdf.model import dot
from texproj.arrays import Doubles

LEAST = 1e-12


class Shadowing(Protocol):
    """The part of facets of normals h that both directions see, (n,) of (n, 3) each."""

    def __call__(self, wi: Doubles, wo: Doubles, h: Doubles) -> Doubles:
        """Directions are above the surface."""


def implicit(wi: Doubles, wo: Doubles, h: Doubles) -> Doubles:
    """The product of the cosines, which cancels the denominator."""
    return wi[:, 2] * wo[:, 2]


def neumann(wi: Doubles, wo: Doubles, h: Doubles) -> Doubles:
    """Neumann, Neumann and Szirmay-Kalos, "Compact metallic reflectance models", 1999."""
    return wi[:, 2] * wo[:, 2] / np.maximum(np.maximum(wi[:, 2], wo[:, 2]), LEAST)


def cook_torrance(wi: Doubles, wo: Doubles, h: Doubles) -> Doubles:
    """V-shaped grooves: Torrance and Sparrow 1967; Cook and Torrance 1982."""
    facing = 2 * h[:, 2] / np.maximum(dot(wo, h), LEAST)
    return np.minimum(1, facing * np.minimum(wi[:, 2], wo[:, 2]))


def kelemen(wi: Doubles, wo: Doubles, h: Doubles) -> Doubles:
    """Kelemen and Szirmay-Kalos, "A microfacet based coupled specular-matte BRDF model", 2001;
    an approximation of Cook and Torrance's, cut at 1.
    """
    return np.minimum(1, wi[:, 2] * wo[:, 2] / np.maximum(dot(wo, h) ** 2, LEAST))


def lambda_beckmann(w: Doubles, alpha_x: float, alpha_y: float) -> Doubles:
    """(n,) Smith's Lambda of Gaussian slopes, exact (Heitz, JCGT 3(2), 2014, table 1)."""
    a = w[:, 2] / np.maximum(np.hypot(alpha_x * w[:, 0], alpha_y * w[:, 1]), LEAST)
    a = np.clip(a, LEAST, 1e6)
    return (erf(a) - 1) / 2 + np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi))


def lambda_ggx(w: Doubles, alpha_x: float, alpha_y: float) -> Doubles:
    """(n,) Smith's Lambda of GGX (ibid., eq. 72)."""
    slope2 = (alpha_x * w[:, 0]) ** 2 + (alpha_y * w[:, 1]) ** 2
    return (np.sqrt(1 + slope2 / np.maximum(w[:, 2] ** 2, LEAST)) - 1) / 2


@dataclass(frozen=True)
class Smith:
    """Smith 1967: independent heights and slopes. Lambda is that of the distribution; `correlated`
    knows that what is high is seen from both sides (Heitz, eq. 99).
    """

    of: Callable[[Doubles, float, float], Doubles]
    alpha_x: float
    alpha_y: float
    correlated: bool = True

    def __call__(self, wi: Doubles, wo: Doubles, h: Doubles) -> Doubles:
        i, o = (self.of(w, self.alpha_x, self.alpha_y) for w in (wi, wo))
        return 1 / (1 + i + o) if self.correlated else 1 / ((1 + i) * (1 + o))

    def one(self, w: Doubles) -> Doubles:
        """(n,) the part that one direction sees."""
        return 1 / (1 + self.of(w, self.alpha_x, self.alpha_y))


def smith_beckmann(alpha: float, correlated: bool = True) -> Smith:
    """For Beckmann's distribution."""
    return Smith(lambda_beckmann, alpha, alpha, correlated)


def smith_ggx(alpha_x: float, alpha_y: float | None = None, correlated: bool = True) -> Smith:
    """For GGX, alike in all directions or not."""
    return Smith(lambda_ggx, alpha_x, alpha_x if alpha_y is None else alpha_y, correlated)


@dataclass(frozen=True)
class Schlick:
    """Schlick, "An inexpensive BRDF model for physically-based rendering", Eurographics 1994:
    c / (c (1 - k) + k) for each direction.
    """

    k: float

    def __call__(self, wi: Doubles, wo: Doubles, h: Doubles) -> Doubles:
        i, o = (w[:, 2] / (w[:, 2] * (1 - self.k) + self.k) for w in (wi, wo))
        return i * o


def schlick_beckmann(alpha: float) -> Schlick:
    """Schlick's k for Beckmann's distribution."""
    return Schlick(alpha * float(np.sqrt(2 / np.pi)))


def schlick_ggx(alpha: float) -> Schlick:
    """Schlick's k for GGX (Karis, "Real shading in Unreal Engine 4", 2013)."""
    return Schlick(alpha / 2)
