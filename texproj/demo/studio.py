"""Photographs of a piece by lamps: a flash on the camera, or lamps of a room in which it is turned.

Light comes straight from lamps of some size and once from the surface around; materials are rough
matte ones (EON) under Beckmann's microfacets, with Fresnel's equations: other models than those
that `appearance` fits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.appearance.brdf.diffuse import EnergyPreservingOrenNayar
from texproj.appearance.brdf.distributions import Beckmann
from texproj.appearance.brdf.fresnel import Dielectric, Schlick
from texproj.appearance.brdf.microfacet import Microfacet
from texproj.appearance.brdf.shadowing import cook_torrance
from texproj.arrays import Doubles, Floats, Index
from texproj.camera import Camera
from texproj.demo import lens
from texproj.demo.caster import Caster
from texproj.demo.light import LIFT, smoothed, unit
from texproj.mesh import Mesh, vertex_normals

GATHERED = 24
"""Rays from each vertex to the surface around."""

SAMPLES = 2
"""Rays per pixel along each side."""

LAMP_POINTS = 3
"""Of a soft lamp, that light comes from along each ray."""

SOFT = 0.05
"""Radius, metres, from which on a lamp is soft."""


@dataclass(frozen=True)
class Stuff:
    """What a part of the piece is made of. slope: of its microfacets (Beckmann's); metal: it
    mirrors in its color, else it is matte under a clear surface of index 1.5; grain: roughness of
    the matte part.
    """

    slope: float
    metal: bool = False
    grain: float = 0.6

    def reflects(self, base: Doubles, wi: Doubles, wo: Doubles) -> Doubles:
        """(n, 3) radiance per irradiance without the cosine; directions in the surface's frame."""
        fresnel = Schlick(0.0) if self.metal else Dielectric(1.5)
        mirror = Microfacet(Beckmann(self.slope), cook_torrance, fresnel).evaluate(wi, wo)
        if not self.metal:
            matte = EnergyPreservingOrenNayar(1.0, self.grain).evaluate(wi, wo)
            return matte[:, None] * base + mirror[:, None]
        white = Microfacet(Beckmann(self.slope), cook_torrance, Schlick(1.0)).evaluate(wi, wo)
        return base * (white - mirror)[:, None] + mirror[:, None]


@dataclass(frozen=True, eq=False)
class Made:
    """Of n points: base (n, 3) linear base color, kind (n,) rows of the list of stuffs."""

    base: Floats
    kind: Index


@dataclass(frozen=True, eq=False)
class Lamp:
    """place: (3,) local frame, metres; radius: of the disk that faces the piece's middle, metres;
    power: (3,) irradiance that it gives square to it at a distance of 1 m, over pi.
    """

    place: Doubles
    radius: float
    power: tuple[float, float, float]


class Studio:
    """A piece and the rays between its parts. Local frame = world here."""

    def __init__(
        self, mesh: Mesh, stuffs: Sequence[Stuff], made_of: Callable[[Floats], Made]
    ) -> None:
        """mesh: the true shape; made_of: what points (n, 3) of it are made of."""
        self.caster = Caster(mesh, np.zeros(3))
        self._normals = vertex_normals(mesh).astype(np.float32)
        self._stuffs, self._made_of = stuffs, made_of
        self._middle = mesh.center
        self._base = made_of(self.caster.vertices).base
        self._met = self._surroundings()

    def _surroundings(self) -> Index:
        """(V, GATHERED) a vertex near what each ray from a vertex meets, -1 where it leaves."""
        rng = np.random.default_rng(5)
        start: Floats = self.caster.vertices + self._normals * np.float32(LIFT)
        out = np.full((len(start), GATHERED), -1)
        for k in range(GATHERED):
            ball = unit(rng.standard_normal(self._normals.shape, np.float32))
            hits = self.caster.first_hits(start, unit(self._normals + ball))
            out[hits.found, k] = self.caster.faces[hits.face, 0]
        return out

    def photographed(
        self, camera: Camera, lamps: Sequence[Lamp], room: Doubles, seed: int
    ) -> Floats:
        """(h, w, 3) linear light, 0 beside the piece. room: (3,) light that comes from everywhere,
        as irradiance over pi.
        """
        rng = np.random.default_rng([seed, 7])
        soft = self._soft(lamps, room, rng)
        h, w = camera.height, camera.width
        out = np.zeros((h * w, 3))
        center = camera.center.astype(np.float32)
        offsets = [(k + 0.5) / SAMPLES for k in range(SAMPLES)]
        for dx, dy in ((x, y) for y in offsets for x in offsets):
            rays = lens.directions(camera.intrinsics, dx, dy).reshape(-1, 3)
            rays = rays @ camera.pose.R.astype(np.float32)
            hits = self.caster.first_hits(np.broadcast_to(center, rays.shape), rays)
            seen = rays[hits.found]
            xyz = center + seen * hits.distance[:, None]
            here = self.caster.at(hits, np.concatenate([self._normals, soft], axis=1))
            made, normals = self._made_of(xyz), unit(here[:, :3])
            light = made.base * here[:, 3:]
            for lamp in lamps:
                points = LAMP_POINTS if lamp.radius > SOFT else 1
                for _ in range(points):
                    light = light + self._by(lamp, xyz, normals, -seen, made, rng) / points
            out[hits.found] += light
        return (out / SAMPLES**2).reshape(h, w, 3).astype(np.float32)

    def _by(
        self, lamp: Lamp, xyz: Floats, normals: Floats, to_eye: Floats, made: Made,
        rng: np.random.Generator,
    ) -> Doubles:  # fmt: skip
        """(n, 3) light of a lamp that points send to the eye."""
        cosine, toward = self._lit(lamp, xyz, normals, rng)
        rows = np.flatnonzero((cosine > 0) & (np.einsum("ij,ij->i", normals, to_eye) > 1e-3))
        wi, wo = in_frames(normals[rows], toward[rows]), in_frames(normals[rows], to_eye[rows])
        sent = np.zeros((len(rows), 3))
        for number, stuff in enumerate(self._stuffs):
            of_it = made.kind[rows] == number
            base = made.base[rows[of_it]].astype(float)
            sent[of_it] = stuff.reflects(base, wi[of_it], wo[of_it])
        out = np.zeros((len(xyz), 3))
        out[rows] = sent * np.pi * cosine[rows, None] * np.array(lamp.power)
        return out

    def _lit(
        self, lamp: Lamp, xyz: Floats, normals: Floats, rng: np.random.Generator
    ) -> tuple[Floats, Floats]:
        """(n,) cosine over squared distance to a random point of the lamp, 0 where something is in
        the way, and (n, 3) the direction to it.
        """
        facing = unit((self._middle - lamp.place)[None].astype(np.float32))
        ball = unit(rng.standard_normal(xyz.shape, np.float32))
        disk = ball - facing * (ball @ facing[0])[:, None]
        disk = unit(disk) * np.sqrt(rng.random((len(xyz), 1), np.float32))
        to = lamp.place.astype(np.float32) + np.float32(lamp.radius) * disk - xyz
        far = np.linalg.norm(to, axis=1)
        to /= far[:, None]
        cosine = np.maximum(np.einsum("ij,ij->i", normals, to), 0)
        lit = np.flatnonzero(cosine)
        hidden = self.caster.blocked(xyz[lit] + normals[lit] * np.float32(LIFT), to[lit])
        cosine[lit[hidden]] = 0
        return cosine / far**2, to

    def _soft(self, lamps: Sequence[Lamp], room: Doubles, rng: np.random.Generator) -> Floats:
        """(V, 3) irradiance over pi at the vertices from the room and from the surface around,
        which is taken for matte there.
        """
        light = np.zeros((len(self._normals), 3), np.float32)
        for lamp in lamps:
            for _ in range(4):
                cosine, _ = self._lit(lamp, self.caster.vertices, self._normals, rng)
                light += cosine[:, None] * np.asarray(lamp.power, np.float32) / 4
        free = np.outer((self._met < 0).mean(axis=1), room).astype(np.float32)
        sent = self._base * (light + free)
        sent = np.concatenate([sent, np.zeros((1, 3), np.float32)])  # row -1: what leaves
        return smoothed((free + sent[self._met].mean(axis=1)).astype(np.float32), self.caster.faces)


def in_frames(normals: NDArray[np.floating], w: NDArray[np.floating]) -> Doubles:
    """(n, 3) directions with the normals (n, 3) as z; how they are turned about it is the same for
    all directions at a point.
    """
    n, d = normals.astype(float), w.astype(float)
    z = np.einsum("ij,ij->i", n, d)
    a = np.cross(n, [0.37, 0.61, 0.7])
    a /= np.maximum(np.linalg.norm(a, axis=1, keepdims=True), 1e-12)
    b = np.cross(n, a)
    return np.stack([np.einsum("ij,ij->i", a, d), np.einsum("ij,ij->i", b, d), z], axis=1)
