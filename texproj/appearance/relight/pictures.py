"""What a camera sees of a surface in a light."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from texproj.appearance.flash.reflection import DIELECTRIC, Angles, linear_terms
from texproj.appearance.relight.illumination import Illumination
from texproj.appearance.relight.lit_surface import LitSurface
from texproj.appearance.relight.radiosity import Obstacles, Radiosity
from texproj.appearance.relight.split_sum import split_sum
from texproj.arrays import Doubles, Floats
from texproj.camera import Camera
from texproj.render import Renderer
from texproj.render.model import Met, draw

LEAST_COSINE = 1e-3


def relit_pictures(
    renderer: Renderer,
    surface: LitSurface,
    light: Illumination,
    cameras: Iterable[Camera],
    samples: int = 2,
) -> Iterator[Floats]:
    """For each camera (h, w, 4) float32: linear luminance times alpha, and alpha.

    Light from lamps straight, with shadows, by GGX and Lambert; light from far away and from the
    surface itself, matte at the vertices, mirrored as one blurred ray (Karis 2013). samples: rays
    per pixel along each axis.
    """
    shading = _Shading(surface, light)
    with renderer.load(surface.mesh) as scene:
        for camera in cameras:
            picture = np.zeros((camera.height, camera.width, 4), np.float32)

            def keep(rows: slice, layers: Floats, picture: Floats = picture) -> None:
                picture[rows] = layers

            def shade(met: Met, camera: Camera = camera) -> Floats:
                return shading.of(met, camera.center)

            draw(scene, shade, camera, samples, keep)
            yield picture


class _Shading:
    """The light on a surface, and what leaves it towards an eye."""

    def __init__(self, surface: LitSurface, light: Illumination) -> None:
        self.surface, self.light = surface, light
        self.obstacles = Obstacles(surface.mesh, surface.normals)
        around = Radiosity.of(self.obstacles, light.environment)
        base = surface.base_of_vertex
        direct = np.zeros((len(base), 3), np.float32)
        everywhere = self.obstacles.xyz, self.obstacles.normals
        for toward, power in self._straight(*everywhere):
            cosine = np.einsum("nc,nc->n", self.obstacles.normals, toward)
            direct += power * np.maximum(cosine, 0)[:, None]
        self.soft = around.around(direct, base)
        self.sent = base / np.float32(np.pi) * (self.soft + direct)
        self.around = (self.soft - around.sky) / np.float32(np.pi)
        self.openness = around.openness

    def _straight(self, xyz: Floats, normals: Floats) -> Iterator[tuple[Floats, Floats]]:
        """Of each lamp (n, 3) directions to it and (n, 3) its light square to them, unless it is
        in the shadow.
        """
        for sun in self.light.suns:
            toward = np.broadcast_to(sun.toward.astype(np.float32), xyz.shape)
            free = self.obstacles.clear(xyz, normals, toward, np.full(len(xyz), np.inf, np.float32))
            yield toward, free[:, None] * sun.illuminance.astype(np.float32)
        for lamp in self.light.lamps:
            gap = (lamp.place - self.obstacles.offset).astype(np.float32) - xyz
            distance = np.maximum(np.linalg.norm(gap, axis=1), np.float32(1e-12))
            toward = gap / distance[:, None]
            free = self.obstacles.clear(xyz, normals, toward, distance)
            yield toward, (free / distance**2)[:, None] * lamp.intensity.astype(np.float32)

    def of(self, met: Met, eye: Doubles) -> Floats:
        """(n, 3) luminance of what rays meet. eye: (3,) world."""
        corner = self.obstacles.faces[met.face]

        def between(values: Floats) -> Floats:
            out: Floats = np.einsum("nk,nk...->n...", met.weights, values[corner])
            return out

        xyz, flat = between(self.obstacles.xyz), _unit(between(self.obstacles.normals))
        normal = self.surface.bent(met, flat)
        to_eye = _unit((eye - self.obstacles.offset).astype(np.float32) - xyz)
        away = np.einsum("nc,nc->n", normal, to_eye) < 0
        base = self.surface.paint(met)
        soft = between(self.soft) * self._turned(normal, flat)
        normal = np.where(away[:, None] & ~met.outside[:, None], -normal, normal)
        roughness, metal = between(self.surface.roughness), between(self.surface.metallic)
        out = base / np.float32(np.pi) * soft * (1 - metal)[:, None]
        spread = _Spread(roughness, between(self.openness), between(self.around))
        scale, bias = split_sum(_cosine(normal, to_eye), roughness)
        f0 = DIELECTRIC * (1 - metal)[:, None] + metal[:, None] * base
        mirrored = self._mirrored(xyz, normal, to_eye, spread)
        out += mirrored * (f0 * scale[:, None] + bias[:, None])
        for toward, power in self._straight(xyz, normal):
            angles, cosine = _angles(normal, to_eye, toward)
            one = np.ones(len(metal), np.float32)
            values = (np.maximum(roughness, 0.05), metal, np.float32(DIELECTRIC) * one, one)
            slope, offset = linear_terms(np.stack(values), angles)
            out += (slope[:, None] * base + offset[:, None]) * power * cosine[:, None]
        return out

    def _turned(self, normal: Floats, flat: Floats) -> Floats | np.float32:
        """(n, 3) light from far away on normals that the normal map bends, over that on those of
        the mesh, between a third and three times.
        """
        sky = self.light.environment
        if sky is None or normal is flat:
            return np.float32(1)
        bent, level = sky.looked_up(normal, 1.0), sky.looked_up(flat, 1.0)
        return np.clip(bent / np.maximum(level, np.float32(1e-12)), 1 / 3, 3).astype(np.float32)

    def _mirrored(self, xyz: Floats, normal: Floats, to_eye: Floats, spread: _Spread) -> Floats:
        """(n, 3) radiance of far away and of the surface around in the mirror of the surface: what
        one ray meets, and the more so the rougher it is what all of them meet on the average.
        """
        nv = _cosine(normal, to_eye)
        toward = _unit(2 * nv[:, None] * normal - to_eye)
        hits = self.obstacles.caster.first(xyz + self.obstacles.lift * normal, toward)
        rough = spread.roughness
        seen = rough[:, None] * spread.around
        if self.light.environment is not None:
            free = (1 - rough) * (hits.face < 0) + rough * spread.openness
            seen += self.light.environment.looked_up(toward, rough) * free[:, None]
        rows = np.flatnonzero(hits.face >= 0)
        u, v = hits.u[rows], hits.v[rows]
        weights = np.stack([1 - u - v, u, v], axis=1) * (1 - rough[rows, None])
        corner = self.obstacles.faces[hits.face[rows]]
        seen[rows] += np.einsum("nk,nkc->nc", weights, self.sent[corner])
        return seen


@dataclass(frozen=True, eq=False)
class _Spread:
    """Where a rough mirror looks: roughness (n,), openness (n,) to what is far away, around (n, 3)
    radiance of the surface in all other directions, times their part.
    """

    roughness: Floats
    openness: Floats
    around: Floats


def _angles(normal: Floats, to_eye: Floats, toward: Floats) -> tuple[Angles, Floats]:
    """The cosines of a lamp's light, and (n,) that to the lamp, 0 from behind."""
    half = _unit(to_eye + toward)
    cosine = np.maximum(np.einsum("nc,nc->n", normal, toward), 0)
    nl = np.maximum(cosine, np.float32(LEAST_COSINE))
    nv = _cosine(normal, to_eye)
    nh = np.clip(np.einsum("nc,nc->n", normal, half), 0, 1)
    vh = np.clip(np.einsum("nc,nc->n", to_eye, half), 0, 1)
    return Angles(nl, nv, nh, vh), cosine


def _cosine(normal: Floats, to_eye: Floats) -> Floats:
    """(n,) never quite aslant."""
    return np.maximum(np.einsum("nc,nc->n", normal, to_eye), np.float32(LEAST_COSINE))


def _unit(vectors: Floats | Doubles) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return (vectors / np.maximum(length, 1e-12)).astype(np.float32)
