"""Sun and sky: what light arrives at a point of the stone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from texproj.arrays import Floats
from texproj.demo.caster import Caster

LIFT = 2e-4
"""Metres by which rays start above the surface, against hitting it at once."""


@dataclass(frozen=True)
class Lighting:
    """Light as irradiance in units in which a matte surface shows as albedo times irradiance,
    linear, at EV 0.

    sun_azimuth_deg counts from +x to +y; sun_disk_deg is the radius of the (hazy) sun.
    bounce: what the ground sends up; echo: what arrives from directions where stone is in the way.
    """

    sun_azimuth_deg: float = -128.0
    sun_elevation_deg: float = 42.0
    sun_disk_deg: float = 0.6
    sun: tuple[float, float, float] = (0.98, 0.87, 0.70)
    sky: tuple[float, float, float] = (0.26, 0.32, 0.42)
    bounce: tuple[float, float, float] = (0.16, 0.14, 0.11)
    echo: tuple[float, float, float] = (0.10, 0.085, 0.07)

    @property
    def to_sun(self) -> Floats:
        """(3,) unit direction towards the sun, local frame."""
        a, e = np.radians(self.sun_azimuth_deg), np.radians(self.sun_elevation_deg)
        return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], np.float32)


def sun_irradiance(
    caster: Caster, xyz: Floats, normals: Floats, lighting: Lighting, rng: np.random.Generator
) -> Floats:
    """(n,) share of the sun that falls on (n, 3) points: cosine, and 0 in a cast shadow.

    One ray per point towards a random point of the sun's disk.
    """
    if not any(lighting.sun):
        return np.zeros(len(xyz), np.float32)
    disk = np.tan(np.radians(lighting.sun_disk_deg))
    jitter = rng.standard_normal((len(xyz), 3), np.float32) * np.float32(disk * 0.5)
    direction = unit(lighting.to_sun + jitter)
    cosine = np.maximum(normals @ lighting.to_sun, 0)
    lit = np.flatnonzero(cosine)
    blocked = caster.blocked(xyz[lit] + normals[lit] * LIFT, direction[lit])
    cosine[lit[blocked]] = 0
    return cosine


def sky_irradiance(
    caster: Caster, xyz: Floats, normals: Floats, lighting: Lighting, rays: int
) -> Floats:
    """(n, 3) light from all directions but the sun at (n, 3) points, by cosine-weighted rays."""
    rng = np.random.default_rng([len(xyz), 17])
    total = np.zeros((len(xyz), 3), np.float32)
    for k in range(rays):
        direction = unit(normals + _ball(len(xyz), k, rays, rng))
        blocked = caster.blocked(xyz + normals * LIFT, direction)
        up = np.clip(direction[:, 2:] * 2.5 + 0.5, 0, 1)
        seen = np.asarray(lighting.bounce, np.float32) * (1 - up) + up * lighting.sky
        seen[blocked] = lighting.echo
        total += seen
    return total / np.float32(rays)


def smoothed(values: Floats, faces: NDArray[np.int32], rounds: int = 4) -> Floats:
    """(V, c) vertex values averaged with their neighbors', against the rays' noise."""
    i = faces[:, [0, 1, 2, 0, 1, 2]].ravel()
    j = faces[:, [1, 2, 0, 2, 0, 1]].ravel()
    count = len(values)
    near = csr_matrix((np.ones(len(i), np.float32), (i, j)), (count, count))
    degree = np.maximum(np.asarray(near.sum(1)), 1)
    for _ in range(rounds):
        values = ((values + (near @ values) / degree) / 2).astype(np.float32)
    return values


def _ball(count: int, k: int, rays: int, rng: np.random.Generator) -> Floats:
    """(count, 3) points on the unit sphere: ray k of a spiral, turned at random per point."""
    z = 1 - 2 * (k + rng.random(count, np.float32)) / rays
    angle = 2 * np.pi * rng.random(count, np.float32)
    ring = np.sqrt(np.maximum(1 - z * z, 0))
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], 1).astype(np.float32)


def unit(vectors: Floats) -> Floats:
    """(n, 3) vectors scaled to length 1."""
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return vectors / np.maximum(length, 1e-12)[:, None]
