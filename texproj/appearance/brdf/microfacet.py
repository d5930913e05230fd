"""Surfaces of small mirrors: Torrance and Sparrow 1967, Cook and Torrance 1982."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.appearance.brdf.distributions import Distribution
from texproj.appearance.brdf.fresnel import Fresnel
from texproj.appearance.brdf.model import above, dot, facet, half, mirrored
from texproj.appearance.brdf.shadowing import Shadowing
from texproj.arrays import Doubles


@dataclass(frozen=True, eq=False)
class Microfacet:
    """D G F / (4 ci co) (Walter et al. 2007, eq. 20). Reciprocal; what is mirrored from one facet
    to the next is lost, so that rough ones reflect less than they get.
    """

    distribution: Distribution
    shadowing: Shadowing
    fresnel: Fresnel

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        seen = above(wi, wo)
        up = np.array([0.0, 0.0, 1.0])
        wi, wo = np.where(seen[:, None], wi, up), np.where(seen[:, None], wo, up)
        h = half(wi, wo)
        facets = self.distribution.density(h) * self.shadowing(wi, wo, h)
        facets = np.where(seen, facets / (4 * wi[:, 2] * wo[:, 2]), 0)
        mirrored_part = self.fresnel(np.clip(dot(wo, h), 0, 1))
        return facets.reshape(facets.shape + (1,) * (mirrored_part.ndim - 1)) * mirrored_part

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        return mirrored(wo, self.distribution.sample(u))

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        h = facet(wi, wo)
        density = self.distribution.density(h) * np.maximum(h[:, 2], 0)
        return density / np.maximum(4 * np.abs(dot(wo, h)), 1e-12)
