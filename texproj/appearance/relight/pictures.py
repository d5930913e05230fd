"""What a camera sees of a surface in a light."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from texproj.appearance.flash.reflection import DIELECTRIC, Angles, linear_terms
from texproj.appearance.relight.illumination import Illumination
from texproj.appearance.relight.radiosity import Obstacles, Radiosity
from texproj.appearance.relight.surface import LitSurface
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
        self.obstacles = Obstacles(surface.mesh)
        around = Radiosity.of(self.obstacles, light.environment)
        base = surface.base_of_vertex
        direct = np.zeros((len(base), 3), np.float32)
        everywhere = self.obstacles.xyz, self.obstacles.normals
        for toward, power in self._straight(*everywhere):
            cosine = np.einsum("nc,nc->n", self.obstacles.normals, toward)
            direct += power * np.maximum(cosine, 0)[:, None]
        self.soft = around.around(direct, base)
        self.sent = base / np.float32(np.pi) * (self.soft + direct)
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

        xyz, normal = between(self.obstacles.xyz), _unit(between(self.obstacles.normals))
        to_eye = _unit((eye - self.obstacles.offset).astype(np.float32) - xyz)
        away = np.einsum("nc,nc->n", normal, to_eye) < 0
        normal = np.where(away[:, None] & ~met.outside[:, None], -normal, normal)
        base, soft = self.surface.paint(met), between(self.soft)
        roughness, metal = between(self.surface.roughness), between(self.surface.metallic)
        out = base / np.float32(np.pi) * soft * (1 - metal)[:, None]
        out += self._mirrored(xyz, normal, to_eye, base, (roughness, metal), between(self.openness))
        for toward, power in self._straight(xyz, normal):
            angles, cosine = _angles(normal, to_eye, toward)
            f0 = np.full(len(metal), DIELECTRIC, np.float32)
            slope, offset = linear_terms(np.maximum(roughness, 0.05), metal, f0, angles)
            out += (slope[:, None] * base + offset[:, None]) * power * cosine[:, None]
        return out

    def _mirrored(
        self, xyz: Floats, normal: Floats, to_eye: Floats, base: Floats,
        gloss: tuple[Floats, Floats], openness: Floats,
    ) -> Floats:  # fmt: skip
        """(n, 3) of far away and of the surface around, in the mirror of the surface."""
        roughness, metal = gloss
        nv = np.maximum(np.einsum("nc,nc->n", normal, to_eye), np.float32(LEAST_COSINE))
        toward = _unit(2 * nv[:, None] * normal - to_eye)
        hits = self.obstacles.caster.first(xyz + self.obstacles.lift * normal, toward)
        free = (hits.face < 0).astype(np.float32)
        seen = np.zeros((len(xyz), 3), np.float32)
        if self.light.environment is not None:
            sky = self.light.environment.looked_up(toward, roughness)
            seen += sky * (free + (openness - free) * roughness)[:, None]
        rows = np.flatnonzero(hits.face >= 0)
        u, v = hits.u[rows], hits.v[rows]
        weights = np.stack([1 - u - v, u, v], axis=1)
        corner = self.obstacles.faces[hits.face[rows]]
        seen[rows] += np.einsum("nk,nkc->nc", weights, self.sent[corner])
        scale, bias = _split_sum(nv, roughness)
        f0 = DIELECTRIC * (1 - metal)[:, None] + metal[:, None] * base
        return seen * (f0 * scale[:, None] + bias[:, None])


def _split_sum(nv: Floats, roughness: Floats) -> tuple[Floats, Floats]:
    """What a GGX mirror reflects of a uniform environment: F0 times the first, plus the second.

    The fit of B. Karis, "Physically based shading on mobile", 2014, after D. Lazarov 2013.
    """
    rx, ry = 1 - roughness, 0.0425 - 0.0275 * roughness
    rz, rw = 1.04 - 0.572 * roughness, 0.022 * roughness - 0.04
    a = np.minimum(rx * rx, np.exp2(-9.28 * nv)) * rx + ry
    return (-1.04 * a + rz).astype(np.float32), (1.04 * a + rw).astype(np.float32)


def _angles(normal: Floats, to_eye: Floats, toward: Floats) -> tuple[Angles, Floats]:
    """The cosines of a lamp's light, and (n,) that to the lamp, 0 from behind."""
    half = _unit(to_eye + toward)
    cosine = np.maximum(np.einsum("nc,nc->n", normal, toward), 0)
    nl = np.maximum(cosine, np.float32(LEAST_COSINE))
    nv = np.maximum(np.einsum("nc,nc->n", normal, to_eye), np.float32(LEAST_COSINE))
    nh = np.clip(np.einsum("nc,nc->n", normal, half), 0, 1)
    vh = np.clip(np.einsum("nc,nc->n", to_eye, half), 0, 1)
    return Angles(nl, nv, nh, vh), cosine


def _unit(vectors: Floats | Doubles) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return (vectors / np.maximum(length, 1e-12)).astype(np.float32)
