"""A lamp of the room: soft, near or far, with the shadows that the object casts on itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texproj.appearance.flash.observations import LampShadows, Surfel, dots, unit
from texproj.appearance.turntable.room import Room
from texproj.arrays import Doubles, Floats, Index
from texproj.render.directions import tangents

FAR = np.inf
RAYS = 8
"""Over the face of a lamp, where its shadows are to be soft."""

MOST = 1 << 20
"""Rays at a time."""


@dataclass(frozen=True, eq=False)
class RoomLamp:
    """direction: (3,) unit vector towards it, axes of the room; distance: from the mesh's center,
    in diagonals of the mesh, `FAR` where it is too far for that to matter; radius_deg: half its
    width, seen from there.
    """

    direction: Doubles
    distance: float = FAR
    radius_deg: float = 1.0

    @property
    def near(self) -> bool:
        """Whether what stands beside the mesh, as a color chart, gets another light from it."""
        return bool(np.isfinite(self.distance))


@dataclass(frozen=True, eq=False)
class RoomLight:
    """What lamps need to know. room: the photos' turns; shadows: of the mesh; diagonal: its."""

    room: Room
    shadows: LampShadows
    diagonal: float

    def irradiance(
        self, lamp: RoomLamp, surfels: Surfel, point: Index, photo: Index, rays: int = RAYS
    ) -> Floats:
        """(m,) of sightings: points of surfels in photos; 1 for a surface at the mesh's center that
        faces the lamp.
        """
        out = np.empty(len(point), np.float32)
        step = max(1, MOST // rays)
        for start in range(0, len(point), step):
            rows = slice(start, start + step)
            out[rows] = self._some(lamp, surfels, point[rows], photo[rows], rays)
        return out

    def _some(
        self, lamp: RoomLamp, surfels: Surfel, point: Index, photo: Index, rays: int
    ) -> Floats:
        near = lamp.near
        reach = np.float32(lamp.distance * self.diagonal if near else 1)
        xyz, normal = surfels.xyz[point], surfels.normal[point]
        start = xyz + self.shadows.lift * normal
        total = np.zeros(len(point), np.float32)
        for aside in _disk(lamp.direction, lamp.radius_deg, rays):
            across = ((lamp.direction + aside) @ self.room.room_from_world).astype(np.float32)
            to, far = unit(across[photo] * reach - xyz) if near else unit(across[photo])
            cosine = dots(normal, to)
            lit = np.flatnonzero(cosine > 0)
            ends = far[lit] if near else None
            free = ~self.shadows.caster.blocked(start[lit], to[lit], ends)
            rows = lit[free]
            fading = np.square(reach / far[rows]) if near else np.float32(1)
            total[rows] += cosine[rows] * fading
        return total / np.float32(rays)


def _disk(direction: Doubles, radius_deg: float, rays: int) -> Doubles:
    """(rays, 3) displacements over a disk square to a direction: Vogel's spiral."""
    if rays == 1:
        return np.zeros((1, 3))
    b1, b2 = (b[0].astype(np.float64) for b in tangents(direction[None].astype(np.float32)))
    number = np.arange(rays)
    radius = np.tan(np.radians(radius_deg)) * np.sqrt((number + 0.5) / rays)
    angle = number * np.pi * (3 - np.sqrt(5))
    return np.outer(radius * np.cos(angle), b1) + np.outer(radius * np.sin(angle), b2)


def varied(lamp: RoomLamp) -> list[RoomLamp]:
    """The lamp nearer and farther, wider and narrower."""
    steps = (1.2, 1.6, 2.2, 3.2, 5.0, FAR)
    widths = (1.0, 4.0, 8.0, 14.0, 22.0)
    near = [replace(lamp, distance=d) for d in steps if d != lamp.distance]
    return near + [replace(lamp, radius_deg=w) for w in widths if w != lamp.radius_deg]
