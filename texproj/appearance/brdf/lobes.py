"""Highlights as powers of a cosine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.appearance.brdf.model import (
    Color,
    above,
    around,
    at_normal,
    colored,
    dot,
    facet,
    from_angles,
    half,
    mirrored,
    unit,
)
from texproj.arrays import Doubles


def lobe_sample(axis: Doubles, exponent: float, u: Doubles) -> Doubles:
    """(n, 3) directions around axes (n, 3), by the power of the cosine to them."""
    local = from_angles(u[:, 0] ** (1 / (exponent + 1)), 2 * np.pi * u[:, 1])
    return around(axis, local)


def lobe_pdf(axis: Doubles, exponent: float, wi: Doubles) -> Doubles:
    """(n,) density of `lobe_sample`."""
    cosine = np.maximum(dot(axis, wi), 0)
    return (exponent + 1) / (2 * np.pi) * cosine**exponent


@dataclass(frozen=True, eq=False)
class Phong:
    """The highlight of Phong, "Illumination for computer generated pictures", CACM 18(6), 1975.

    As printed, its radiance knows no cosine of the light, so that as a BRDF it is divided by it:
    neither reciprocal, nor bounded. Exponent 0 = the same in all directions.
    """

    specular: Color = 1.0
    exponent: float = 20.0

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        seen = above(wi, wo)
        cosine = np.maximum(dot(at_normal(wi), wo), 0)
        return colored(seen * cosine**self.exponent / np.where(seen, wi[:, 2], 1), self.specular)

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        return lobe_sample(at_normal(wo), self.exponent, u)

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        return lobe_pdf(at_normal(wo), self.exponent, wi)


@dataclass(frozen=True, eq=False)
class ModifiedPhong:
    """Phong's highlight made plausible: reciprocal, and of no more light than `specular`.

    Lafortune and Willems, "Using the modified Phong reflectance model for physically based
    rendering", 1994: (n + 2) / (2 pi) cos^n, all of the light at normal incidence.
    """

    specular: Color = 1.0
    exponent: float = 20.0

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        cosine = np.maximum(dot(at_normal(wi), wo), 0)
        factor = (self.exponent + 2) / (2 * np.pi)
        return colored(above(wi, wo) * factor * cosine**self.exponent, self.specular)

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        return lobe_sample(at_normal(wo), self.exponent, u)

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        return lobe_pdf(at_normal(wo), self.exponent, wi)


@dataclass(frozen=True, eq=False)
class BlinnPhong:
    """The highlight by the half vector: Blinn, "Models of light reflection for computer synthesized
    pictures", SIGGRAPH 1977. Reciprocal.

    Normalized such that at normal incidence `specular` of the light is reflected (F. Giesen, 2009):
    (n + 2) (n + 4) / (8 pi (2^(-n/2) + n)); at grazing incidence a little more is.
    """

    specular: Color = 1.0
    exponent: float = 20.0

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        n = self.exponent
        factor = (n + 2) * (n + 4) / (8 * np.pi * (2 ** (-n / 2) + n))
        cosine = np.maximum(half(wi, wo)[:, 2], 0)
        return colored(above(wi, wo) * factor * cosine**n, self.specular)

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        h = from_angles(u[:, 0] ** (1 / (self.exponent + 1)), 2 * np.pi * u[:, 1])
        return mirrored(wo, h)

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        h = facet(wi, wo)
        density = (self.exponent + 1) / (2 * np.pi) * np.maximum(h[:, 2], 0) ** self.exponent
        return density / np.maximum(4 * np.abs(dot(wo, h)), 1e-12)


@dataclass(frozen=True)
class Lobe:
    """One of Lafortune's lobes: (x, y, z) factors on the products of the directions' coordinates,
    and their exponent. (-1, -1, 1) mirrors, (1, 1, 1) throws back to the light.
    """

    x: float
    y: float
    z: float
    exponent: float
    weight: Color = 1.0


@dataclass(frozen=True, eq=False)
class Lafortune:
    """A sum of lobes: Lafortune, Foo, Torrance and Greenberg, "Non-linear approximation of
    reflectance functions", SIGGRAPH 1997, eq. 12. Reciprocal.
    """

    lobes: Sequence[Lobe]

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        seen = above(wi, wo)
        parts = [
            colored(seen * np.maximum(dot(self._turned(lobe, wo), wi), 0) ** lobe.exponent,
                    lobe.weight)
            for lobe in self.lobes
        ]  # fmt: skip
        return np.sum(parts, axis=0)

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        chosen = np.minimum((u[:, 2] * len(self.lobes)).astype(int), len(self.lobes) - 1)
        out = np.empty_like(wo)
        for number, lobe in enumerate(self.lobes):
            rows = chosen == number
            axis = unit(self._turned(lobe, wo[rows]))
            out[rows] = lobe_sample(axis, lobe.exponent, u[rows])
        return out

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        parts = [lobe_pdf(unit(self._turned(x, wo)), x.exponent, wi) for x in self.lobes]
        return np.mean(parts, axis=0)

    @staticmethod
    def _turned(lobe: Lobe, wo: Doubles) -> Doubles:
        return wo * np.array([lobe.x, lobe.y, lobe.z])
