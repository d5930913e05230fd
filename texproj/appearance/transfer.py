"""How light comes to points of the surface: from the sky past obstacles, from the sun, and from
the surface around.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.cells import Cells, Spots
from texproj.appearance.harmonics import BASES, basis
from texproj.arrays import Doubles, Floats, Index
from texproj.mesh import Mesh
from texproj.render.directions import cosine_directions, tangents
from texproj.render.rays import CHUNK, RayCaster
from texproj.render.surface import Surface

LIFT = 1e-4
"""How far rays start above the surface, as a part of the diagonal, as for ambient occlusion."""

RAYS = 96
"""Per point: the irradiance of a sky is then right to 1 to 2 %."""

SUN_RADIUS_DEG = 0.5
"""The sun's own 0.27, and what the mesh rounds off."""

SUN_RAYS = 8
"""To each vertex, from as many points of its cell."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """What light from everywhere becomes at n points.

    sky: (n, 9) float32 irradiance by each spherical harmonic of the radiance of what is far away;
    indirect: (n, 3) float32 irradiance from the surface itself; openness: (n,) float32 the part
    of the sky that is seen, cosine-weighted.
    """

    sky: Floats
    indirect: Floats
    openness: Floats


class LightCaster:
    """Rays over a mesh of known radiance.

    rgb: (V, 3) float32 linear light that the vertices send out, the same in all directions: what a
    photo shows of a matte surface.
    """

    def __init__(self, mesh: Mesh, rgb: Floats) -> None:
        surface = Surface(mesh)
        self.xyz, self.normals = surface.xyz_in_local, surface.normal_in_world
        self._faces, self._rgb = mesh.faces, rgb
        self._caster = RayCaster(self.xyz, mesh.faces)
        self._lift = np.float32(LIFT * mesh.diagonal)
        self._mesh = mesh

    @cached_property
    def cells(self) -> Cells:
        """What the colors of the vertices are averages of."""
        return Cells(self._mesh, self.xyz)

    def transfer(self, chosen: Index, rays: int = RAYS, seed: int = 0) -> Transfer:
        """The transfer of some of the vertices, by cosine-distributed rays.

        Irradiance is pi times the mean radiance along them. Light that comes from the surface is
        exact for a matte one and needs no unknown: what is hit sends out the color that it has in
        the photos.
        """
        shifts = np.random.default_rng(seed).random((len(self.xyz), 2), np.float32)
        sky = np.empty((len(chosen), BASES), np.float32)
        indirect = np.empty((len(chosen), 3), np.float32)
        openness = np.empty(len(chosen), np.float32)
        step = max(1, CHUNK // rays)
        for start in range(0, len(chosen), step):
            rows = chosen[start : start + step]
            part = slice(start, start + len(rows))
            directions = cosine_directions(self.normals[rows], shifts[rows], rays)
            free, arriving = self._arriving(rows, directions.reshape(-1, 3))
            harmonics = basis(directions.reshape(-1, 3)) * free[:, None]
            sky[part] = np.pi * harmonics.reshape(len(rows), rays, BASES).mean(axis=1)
            indirect[part] = np.pi * arriving.reshape(len(rows), rays, 3).mean(axis=1)
            openness[part] = free.reshape(len(rows), rays).mean(axis=1)
        return Transfer(sky, indirect, openness)

    def _arriving(self, rows: Index, directions: Floats) -> tuple[NDArray[np.bool_], Floats]:
        """(m,) which rays leave the mesh, and (m, 3) the radiance that the others meet."""
        origins = self.xyz[rows] + self._lift * self.normals[rows]
        hits = self._caster.first(np.repeat(origins, len(directions) // len(rows), 0), directions)
        met = np.flatnonzero(hits.face >= 0)
        corner = self._faces[hits.face[met]]
        u, v = hits.u[met, None], hits.v[met, None]
        arriving = np.zeros((len(directions), 3), np.float32)
        a, b, c = (self._rgb[corner[:, k]] for k in range(3))
        arriving[met] = (1 - u - v) * a + u * b + v * c
        return hits.face < 0, arriving

    def sun(self, spots: Spots, to_sun: Doubles) -> Floats:
        """(n,) cosine to the sun on the mean over the spots of n vertices, 0 in its cast shadow.

        to_sun: (3,) unit vector; each spot looks at another part of a disk of `SUN_RADIUS_DEG`.
        """
        toward = _disk(to_sun.astype(np.float32), len(spots.xyz))
        parts = zip(spots.xyz, spots.normal, toward, strict=True)
        total = sum(self._cosine(xyz, normals, one) for xyz, normals, one in parts)
        return np.asarray(total, np.float32) / np.float32(len(toward))

    def sun_on(self, vertices: Index, to_sun: Doubles) -> Floats:
        """(n,) the same of some of the vertices, by `SUN_RAYS` spots each, some at a time."""
        step = max(1, CHUNK // SUN_RAYS)
        parts = [vertices[start : start + step] for start in range(0, len(vertices), step)]
        shown = [self.sun(self.cells.spots(part, SUN_RAYS), to_sun) for part in parts]
        return np.concatenate([np.zeros(0, np.float32), *shown])

    def sun_at(self, xyz: Floats, normals: Floats, to_sun: Doubles, rays: int) -> Floats:
        """(n,) the same at points (n, 3) of the surface, relative to the mesh's center, with unit
        normals (n, 3): each looks at all of the disk.
        """
        return self.sun(
            Spots(*(np.broadcast_to(x, (rays, *x.shape)) for x in (xyz, normals))), to_sun
        )

    def _cosine(self, xyz: Floats, normals: Floats, toward: Floats) -> Floats:
        """(n,) cosine of unit normals (n, 3) to a direction, 0 where something is before it."""
        cosine = np.maximum(normals @ toward, 0)
        lit = np.flatnonzero(cosine)
        origins = xyz[lit] + self._lift * normals[lit]
        cosine[lit] *= ~self._caster.blocked(origins, np.broadcast_to(toward, origins.shape))
        return cosine


def _disk(toward: Floats, rays: int) -> Floats:
    """(rays, 3) unit vectors over the sun's disk: a spiral of equal areas (Vogel 1979)."""
    if rays == 1:
        return toward[None]
    b1, b2 = (b[0] for b in tangents(toward[None]))
    number = np.arange(rays)
    radius = np.tan(np.radians(SUN_RADIUS_DEG)) * np.sqrt((number + 0.5) / rays)
    angle = number * np.pi * (3 - np.sqrt(5))
    away = np.cos(angle)[:, None] * b1 + np.sin(angle)[:, None] * b2
    out = toward + radius[:, None] * away
    return (out / np.linalg.norm(out, axis=1, keepdims=True)).astype(np.float32)
