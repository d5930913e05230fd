"""What every model of reflectance answers, and the directions that they share.

Directions are (n, 3) float64 unit vectors in the frame of the surface: z is its normal; both point
away from it, `wi` to where light comes from and `wo` to where it goes. A value is that of the BRDF,
per steradian, without the cosine. Colors of a model are numbers, for (n,) values, or arrays (c,),
for (n, c). Roughness `alpha` is the slope of the microfacets, not its square root, which glTF and
others call roughness.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from texproj.arrays import Bools, Doubles

Color = float | Doubles


class Brdf(Protocol):
    """A model of reflectance."""

    def evaluate(self, wi: Doubles, wo: Doubles) -> Doubles:
        """(n,) or (n, c) reflected radiance per irradiance, 1 / sr; 0 below the surface."""

    def sample(self, wo: Doubles, u: Doubles) -> Doubles:
        """(n, 3) directions of light for importance sampling, from (n, 3) uniform numbers in 0..1;
        some may lie below the surface.
        """

    def pdf(self, wi: Doubles, wo: Doubles) -> Doubles:
        """(n,) density, 1 / sr, with which `sample` gives wi."""


def above(wi: Doubles, wo: Doubles) -> Bools:
    """(n,) whether both directions are on the side of the normal."""
    return (wi[:, 2] > 0) & (wo[:, 2] > 0)


def colored(values: Doubles, color: Color) -> Doubles:
    """(n,) values times a color: (n,) or (n, c)."""
    return np.multiply.outer(values, color)


def dot(a: Doubles, b: Doubles) -> Doubles:
    """(n,) products of (n, 3) vectors."""
    return np.einsum("ij,ij->i", a, b)


def unit(vectors: Doubles) -> Doubles:
    """(n, 3) scaled to length 1; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)


def half(wi: Doubles, wo: Doubles) -> Doubles:
    """(n, 3) unit vectors between two directions."""
    return unit(wi + wo)


def facet(wi: Doubles, wo: Doubles) -> Doubles:
    """(n, 3) the normal, above the surface, of the facet that mirrors one to the other, also where
    it is seen from behind.
    """
    h = half(wi, wo)
    return h * np.where(h[:, 2:] < 0, -1.0, 1.0)


def mirrored(wo: Doubles, h: Doubles) -> Doubles:
    """(n, 3) wo, mirrored at a facet of normal h."""
    return 2 * dot(wo, h)[:, None] * h - wo


def at_normal(w: Doubles) -> Doubles:
    """(n, 3) mirrored at the surface itself."""
    return w * np.array([-1.0, -1.0, 1.0])


def from_angles(cosine: Doubles, phi: Doubles) -> Doubles:
    """(n, 3) unit vectors so far from z and around it."""
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)


def cosine_sample(u: Doubles) -> Doubles:
    """(n, 3) directions above the surface by density cosine / pi, from (n, 2 or more) numbers."""
    return from_angles(np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1])


def cosine_pdf(wi: Doubles) -> Doubles:
    """(n,) the density of `cosine_sample`."""
    return np.maximum(wi[:, 2], 0) / np.pi


def around(axis: Doubles, local: Doubles) -> Doubles:
    """(n, 3) vectors given in frames whose z is `axis` (n, 3). Duff et al., JCGT 6(1), 2017."""
    x, y, z = axis.T
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    first = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    second = np.stack([b, sign + y * y * a, -y], axis=1)
    return local[:, :1] * first + local[:, 1:2] * second + local[:, 2:] * axis
