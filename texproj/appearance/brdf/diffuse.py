"""Matte surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.appearance.brdf.model import (
    Color,
    above,
    colored,
    cosine_pdf,
    cosine_sample,
    dot,
)
from texproj.arrays import Doubles


@dataclass(frozen=True, eq=False)
class Lambert:
    """The same radiance in all directions. Reciprocal; reflects `albedo` of all light."""

    albedo: Color = 1.0

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        return colored(above(wi, wo) / np.pi, self.albedo)

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        return cosine_sample(u)

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        return cosine_pdf(wi)


@dataclass(frozen=True, eq=False)
class OrenNayar:
    """Rough matte surfaces: V-shaped grooves of Lambert's law. Reciprocal; loses light.

    The qualitative model of Oren and Nayar, "Generalization of Lambert's reflectance model",
    SIGGRAPH 1994, eq. 30, and, with `interreflection`, the albedo term that Wolff, Nayar and Oren,
    IJCV 30(1), 1998, add to it: 0.17 albedo sigma^2 / (sigma^2 + 0.13). sigma: standard deviation
    of the grooves' angle, radians.
    """

    albedo: Color = 1.0
    sigma: float = 0.3
    interreflection: bool = False

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        s2 = self.sigma**2
        a = 1 - 0.5 * s2 / (s2 + 0.33)
        b = 0.45 * s2 / (s2 + 0.09)
        ci, co = wi[:, 2], wo[:, 2]
        seen = above(wi, wo)
        along = np.maximum(wi[:, 0] * wo[:, 0] + wi[:, 1] * wo[:, 1], 0)
        # max(0, cos of the azimuths) sin(alpha) tan(beta), free of angles
        slope = along / np.where(seen, np.maximum(ci, co), 1)
        single = colored(seen * (a + b * slope) / np.pi, self.albedo)
        if not self.interreflection:
            return single
        bounced = 0.17 * s2 / (s2 + 0.13) * np.square(self.albedo)
        return single + colored(seen / np.pi, bounced)

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        return cosine_sample(u)

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        return cosine_pdf(wi)


@dataclass(frozen=True, eq=False)
class EnergyPreservingOrenNayar:
    """The same look, and no light is lost: an albedo of 1 reflects all. Reciprocal.

    EON, Portsmouth, Kutz and Hill, "EON: a practical energy-preserving rough diffuse BRDF", JCGT
    14(1), 2025: Fujii's variant of the model, and several scatterings. roughness: 0..1.
    """

    albedo: Color = 1.0
    roughness: float = 0.5

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        ci, co = wi[:, 2], wo[:, 2]
        seen = above(wi, wo)
        s = dot(wi, wo) - ci * co
        ratio = np.where(s > 0, s / np.where(seen, np.maximum(ci, co), 1), s)
        single = seen * self._a * (1 + self.roughness * ratio) / np.pi
        mean = self._a * (1 + (2 / 3 - 28 / (15 * np.pi)) * self.roughness)
        lost = [1 - self.once(np.clip(c, 1e-6, 1)) for c in (ci, co)]
        again = seen * lost[0] * lost[1] / max(1 - mean, 1e-12) / np.pi
        rho = np.asarray(self.albedo)
        return colored(single, rho) + colored(again, rho**2 * mean / (1 - rho * (1 - mean)))

    def once(self, cosine: Doubles) -> Doubles:
        """(n,) the part of light from angles of these cosines that leaves after one scattering."""
        sine = np.sqrt(np.maximum(1 - cosine**2, 0))
        angle = np.arccos(cosine)
        g = sine * (angle - sine * cosine) + 2 / 3 * (sine / cosine * (1 - sine**3) - sine)
        return self._a * (1 + self.roughness / np.pi * g)

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        return cosine_sample(u)

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        return cosine_pdf(wi)

    @property
    def _a(self) -> float:
        return 1 / (1 + (0.5 - 2 / (3 * np.pi)) * self.roughness)
