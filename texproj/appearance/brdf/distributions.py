"""How the normals of microfacets are spread: D. Each integrates, times the cosine, to 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from texproj.appearance.brdf.model import from_angles, unit
from texproj.arrays import Doubles


class Distribution(Protocol):
    """A spread of microfacets' normals around z."""

    def density(self, h: Doubles) -> Doubles:
        """(n,) area of facets of normals h (n, 3) per surface and steradian."""

    def sample(self, u: Doubles) -> Doubles:
        """(n, 3) normals by density times cosine, from (n, 2 or more) uniform numbers."""


@dataclass(frozen=True)
class Beckmann:
    """Gaussian slopes (Beckmann and Spizzichino 1963; Cook and Torrance 1982)."""

    alpha: float

    def density(self, h: Doubles) -> Doubles:
        c2 = np.maximum(h[:, 2], 1e-12) ** 2
        value = np.exp((c2 - 1) / (c2 * self.alpha**2)) / (np.pi * self.alpha**2 * c2**2)
        return np.where(h[:, 2] > 0, value, 0)

    def sample(self, u: Doubles) -> Doubles:
        slope2 = -(self.alpha**2) * np.log(np.maximum(1 - u[:, 0], 1e-300))
        return from_angles(1 / np.sqrt(1 + slope2), 2 * np.pi * u[:, 1])


@dataclass(frozen=True)
class GGX:
    """Long tails: Walter et al., "Microfacet models for refraction", EGSR 2007, eq. 33; Trowbridge
    and Reitz 1975.
    """

    alpha: float

    def density(self, h: Doubles) -> Doubles:
        a2 = self.alpha**2
        value = a2 / (np.pi * (h[:, 2] ** 2 * (a2 - 1) + 1) ** 2)
        return np.where(h[:, 2] > 0, value, 0)

    def sample(self, u: Doubles) -> Doubles:
        cosine = np.sqrt((1 - u[:, 0]) / (1 + (self.alpha**2 - 1) * u[:, 0]))
        return from_angles(cosine, 2 * np.pi * u[:, 1])


@dataclass(frozen=True)
class AnisotropicGGX:
    """GGX of two slopes along the tangents: Burley, "Physically-based shading at Disney", 2012,
    eq. 13.
    """

    alpha_x: float
    alpha_y: float

    def density(self, h: Doubles) -> Doubles:
        x, y, z = h.T
        spread = (x / self.alpha_x) ** 2 + (y / self.alpha_y) ** 2 + z**2
        value = 1 / (np.pi * self.alpha_x * self.alpha_y * spread**2)
        return np.where(z > 0, value, 0)

    def sample(self, u: Doubles) -> Doubles:
        """Ibid., eq. 14."""
        slope = np.sqrt(u[:, 0] / np.maximum(1 - u[:, 0], 1e-12))
        phi = 2 * np.pi * u[:, 1]
        x, y = slope * self.alpha_x * np.cos(phi), slope * self.alpha_y * np.sin(phi)
        return unit(np.stack([x, y, np.ones_like(x)], axis=1))


@dataclass(frozen=True)
class Blinn:
    """A power of the cosine (Blinn 1977), whose exponent follows from alpha: 2 / alpha^2 - 2."""

    alpha: float

    @property
    def exponent(self) -> float:
        """Of the cosine, as wide as Beckmann's of the same alpha."""
        return 2 / self.alpha**2 - 2

    def density(self, h: Doubles) -> Doubles:
        cosine = np.maximum(h[:, 2], 0)
        value = (self.exponent + 2) / (2 * np.pi) * cosine**self.exponent
        return np.where(h[:, 2] > 0, value, 0)

    def sample(self, u: Doubles) -> Doubles:
        return from_angles(u[:, 0] ** (1 / (self.exponent + 2)), 2 * np.pi * u[:, 1])
