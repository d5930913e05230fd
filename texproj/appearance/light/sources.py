"""Sources of light, and the irradiance that they give to points of a surface.

Intensity is in candela, luminance in candela per square metre, irradiance in lux where lengths are
metres; each times a color of luminance 1. What stands between is not looked at: rays do that.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from texproj.appearance.harmonics import basis
from texproj.appearance.light.ies import Profile
from texproj.arrays import Doubles

WHITE = np.ones(3)
DISK_SIDES = 64
"""Of the polygon of the same area that a disk is taken for: .2 % off where it is near."""


class Source(Protocol):
    """Something that shines."""

    def irradiance(self, xyz: Doubles, normal: Doubles) -> Doubles:
        """(n, 3) at points (n, 3) of unit normals (n, 3), in the open."""


def candela_of_lumens(lumens: float) -> float:
    """Of a point that shines alike in all directions: over 4 pi."""
    return lumens / (4 * np.pi)


def candela_of_spot(lumens: float, outer_deg: float) -> float:
    """Of an even cone of light, outer_deg from its axis: over its solid angle."""
    return float(lumens / (2 * np.pi * (1 - np.cos(np.radians(outer_deg)))))


def luminance_of_area(lumens: float, area: float) -> float:
    """Of a matte luminous area, one-sided: over pi times the area."""
    return lumens / (np.pi * area)


@dataclass(frozen=True, eq=False)
class Point:
    """A point. place: (3,); candela: in all directions, or along the axis of `profile`; color:
    (3,) of luminance 1; profile: of a lamp, by whose own file candela counts as a factor; turn:
    (3, 3) rotation from the world's axes to the profile's, where -z is down.
    """

    place: Doubles
    candela: float
    color: Doubles = field(default_factory=lambda: WHITE)
    profile: Profile | None = None
    turn: Doubles = field(default_factory=lambda: np.eye(3))

    def irradiance(self, xyz: Doubles, normal: Doubles) -> Doubles:
        """The inverse square law."""
        toward, distance = _unit(self.place - xyz)
        intensity = self.candela * self._part(-toward)
        lux = intensity * np.maximum((toward * normal).sum(1), 0) / distance**2
        return lux[:, None] * self.color

    def _part(self, away: Doubles) -> Doubles:
        if self.profile is None:
            return np.ones(len(away))
        return self.profile.intensity(away @ self.turn.T)


@dataclass(frozen=True, eq=False)
class Spot:
    """A cone of light that fades from inner to outer degrees from its axis, smoothly (KHR_lights_-
    punctual's fall-off). place, axis: (3,); candela: along the axis.
    """

    place: Doubles
    axis: Doubles
    candela: float
    inner_deg: float
    outer_deg: float
    color: Doubles = field(default_factory=lambda: WHITE)

    def irradiance(self, xyz: Doubles, normal: Doubles) -> Doubles:
        """The inverse square law within the cone."""
        toward, distance = _unit(self.place - xyz)
        axis = self.axis / np.linalg.norm(self.axis)
        inner, outer = (np.cos(np.radians(a)) for a in (self.inner_deg, self.outer_deg))
        t = np.clip((-toward @ axis - outer) / max(inner - outer, 1e-4), 0, 1)
        lux = self.candela * t * t * np.maximum((toward * normal).sum(1), 0) / distance**2
        return lux[:, None] * self.color


@dataclass(frozen=True, eq=False)
class Directional:
    """Light from very far away. toward: (3,) to it; lux: on what faces it."""

    toward: Doubles
    lux: float
    color: Doubles = field(default_factory=lambda: WHITE)

    def irradiance(self, xyz: Doubles, normal: Doubles) -> Doubles:
        """The cosine law."""
        del xyz
        toward = self.toward / np.linalg.norm(self.toward)
        return self.lux * np.maximum(normal @ toward, 0)[:, None] * self.color


@dataclass(frozen=True, eq=False)
class Polygon:
    """A matte luminous area. corners: (k, 3), counter-clockwise as seen from where it shines;
    luminance: cd / m^2.
    """

    corners: Doubles
    luminance: float
    color: Doubles = field(default_factory=lambda: WHITE)

    def irradiance(self, xyz: Doubles, normal: Doubles) -> Doubles:
        """Exact, by Lambert's formula for polygons (Photometria, 1760; Baum et al., SIGGRAPH 1989,
        eq. 7), what is below the horizon cut off.
        """
        across = np.cross(self.corners[1] - self.corners[0], self.corners[2] - self.corners[1])
        front = (xyz - self.corners[0]) @ across > 0
        lux = np.array([
            _lambert(_above(self.corners - p, n), n) if shone else 0.0
            for p, n, shone in zip(xyz, normal, front, strict=True)
        ])  # fmt: skip
        return self.luminance * lux[:, None] * self.color


def rectangle(center: Doubles, half_x: Doubles, half_y: Doubles, luminance: float) -> Polygon:
    """It shines along half_x x half_y; both (3,)."""
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return Polygon(np.array([center + a * half_x + b * half_y for a, b in signs]), luminance)


def disk(center: Doubles, axis: Doubles, radius: float, luminance: float) -> Polygon:
    """It shines along its axis (3,)."""
    z = axis / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    angle = 2 * np.pi * np.arange(DISK_SIDES) / DISK_SIDES
    same_area = radius * np.sqrt(2 * np.pi / DISK_SIDES / np.sin(2 * np.pi / DISK_SIDES))
    ring = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
    return Polygon(center + same_area * ring, luminance)


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from all around. image: (h, 2 h, 3) radiance; the middle of its first row looks along
    +z, its columns go around z from +x towards +y.
    """

    image: Doubles

    def radiance(self, directions: Doubles) -> Doubles:
        """(n, 3) along unit directions (n, 3), by the nearest pixel."""
        height, width = self.image.shape[:2]
        row = np.arccos(np.clip(directions[:, 2], -1, 1)) / np.pi * height
        column = np.arctan2(directions[:, 1], directions[:, 0]) % (2 * np.pi) / (2 * np.pi) * width
        row, column = row.astype(int).clip(0, height - 1), column.astype(int).clip(0, width - 1)
        return self.image[row, column]

    def pixels(self) -> tuple[Doubles, Doubles]:
        """(h w, 3) directions of the pixels and (h w,) their solid angles."""
        height, width = self.image.shape[:2]
        theta = np.pi * (np.arange(height) + 0.5) / height
        phi = 2 * np.pi * (np.arange(width) + 0.5) / width
        theta, phi = np.meshgrid(theta, phi, indexing="ij")
        across = np.sin(theta)
        d = np.stack([across * np.cos(phi), across * np.sin(phi), np.cos(theta)], axis=-1)
        edges = np.cos(np.pi * np.arange(height + 1) / height)
        solid = np.repeat((edges[:-1] - edges[1:]) * 2 * np.pi / width, width)
        return d.reshape(-1, 3), solid

    def harmonics(self) -> Doubles:
        """(9, 3) radiance by spherical harmonics (`harmonics.basis`)."""
        d, solid = self.pixels()
        out: Doubles = (basis(d) * solid[:, None]).T @ self.image.reshape(-1, 3)
        return out

    def irradiance(self, xyz: Doubles, normal: Doubles) -> Doubles:
        """The cosine-weighted integral over the pixels."""
        del xyz
        d, solid = self.pixels()
        light = self.image.reshape(-1, 3) * solid[:, None]
        return np.stack([np.maximum(d @ n, 0) @ light for n in normal])


def _unit(vectors: Doubles) -> tuple[Doubles, Doubles]:
    length = np.maximum(np.linalg.norm(vectors, axis=1), 1e-12)
    return vectors / length[:, None], length


def _above(corners: Doubles, normal: Doubles) -> Doubles:
    """A polygon (k, 3) relative to a point, cut at the horizon (Sutherland and Hodgman 1974)."""
    height = corners @ normal
    if (height >= 0).all():
        return corners
    out = []
    for k in range(len(corners)):
        a, b = corners[k - 1], corners[k]
        up, next_up = height[k - 1], height[k]
        if up * next_up < 0:
            out.append(a + (b - a) * (up / (up - next_up)))
        if next_up >= 0:
            out.append(b)
    return np.array(out).reshape(-1, 3)


def _lambert(corners: Doubles, normal: Doubles) -> float:
    """Irradiance of a polygon of luminance 1 at the origin: half the sum over edges of the angle
    under which each is seen times the cosine of the normal to the edge's plane.
    """
    if len(corners) < 3:
        return 0.0
    d = corners / np.maximum(np.linalg.norm(corners, axis=1, keepdims=True), 1e-12)
    after = np.roll(d, -1, axis=0)
    across = np.cross(d, after)
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, (d * after).sum(1))
    cosine = across @ normal / np.maximum(sine, 1e-15)
    return abs(0.5 * float((angle * cosine).sum()))
