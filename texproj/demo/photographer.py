"""Photographs of a carved piece by casting rays: an image maker that shares nothing with the
renderer under test but the definition of a camera.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.demo import backdrop, lens
from texproj.demo.caster import Caster
from texproj.demo.light import Lighting, sky_irradiance, smoothed, sun_irradiance, unit
from texproj.demo.pattern import Pattern
from texproj.demo.sensor import Sensor, defocused, developed
from texproj.demo.visitor import in_front
from texproj.mesh import Mesh, vertex_normals

CHUNK = 1 << 15
"""Rays at a time, so that intermediate values stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A piece in its place, lit. Local frame = world minus `origin`.

    surface: (V, 6) float32, normal and sky light of each vertex of the caster's mesh;
    hull: (k, 3) corners of its convex hull; gloss: strength of the highlight (0 matte,
    1 polished), roughness: of its microfacets.
    """

    caster: Caster
    surface: Floats
    hull: Floats
    pattern: Pattern
    lighting: Lighting
    origin: NDArray[np.float64]
    gloss: float = 0.0
    roughness: float = 0.3


@dataclass(frozen=True)
class ShotOptions:
    """How one photo is taken. samples: rays per pixel along each side; sensor: exposure, noise;
    defocus_px: radius of the blur disk; visitor: somebody stands in the picture.
    """

    samples: int = 2
    background: Literal["garden", "gradient", "wall"] = "garden"
    sensor: Sensor = field(default_factory=Sensor)
    vignetting: float = 0.25
    defocus_px: float = 0.0
    visitor: bool = False
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Shot:
    """pixels: (h, w, 3) uint8 sRGB; object_mask: (h, w) uint8, 255 where the piece is seen;
    light: (h, w, 3) float32, what came through the lens before vignetting and the sensor.
    """

    pixels: NDArray[np.uint8]
    object_mask: NDArray[np.uint8]
    light: Floats


def set_up(
    mesh: Mesh, pattern: Pattern, lighting: Lighting, gloss: float = 0.0, sky_rays: int = 16,
    origin: NDArray[np.float64] | None = None,
) -> Scene:  # fmt: skip
    """The scene with sky light computed once for all photos; mesh in world coordinates."""
    place = np.zeros(3) if origin is None else np.asarray(origin, np.float64)
    caster = Caster(mesh, place)
    normals = vertex_normals(mesh).astype(np.float32)
    sky = sky_irradiance(caster, caster.vertices, normals, lighting, sky_rays)
    surface = np.concatenate([normals, smoothed(sky, caster.faces)], axis=1)
    hull = caster.vertices[ConvexHull(caster.vertices).vertices]
    return Scene(caster, surface, hull, pattern, lighting, place, gloss)


def photograph(scene: Scene, camera: Camera, options: ShotOptions | None = None) -> Shot:
    """One photo: rays through the full lens model, then defocus, vignetting and the sensor."""
    how = options or ShotOptions()
    rng = np.random.default_rng([how.seed, 3])
    light, coverage = _stone(scene, camera, how.samples, rng)
    light += _behind(scene, camera, how, 1 - coverage)
    if how.visitor:
        light, hidden = in_front(light, rng)
        coverage = coverage * (1 - hidden)
    light = defocused(light, how.defocus_px)
    falloff = lens.vignetting(camera.intrinsics, how.vignetting)
    pixels = developed(light * falloff[..., None], how.sensor, rng)
    return Shot(pixels, np.where(coverage > 0.5, 255, 0).astype(np.uint8), light)


def shaded(scene: Scene, xyz: Floats, normals: Floats, sky: Floats, seed: int = 0) -> Floats:
    """(n, 3) light that (n, 3) surface points of the local frame send out, no highlight.

    The sun's disk is sampled by 16 rays per point.
    """
    rng = np.random.default_rng([seed, 23])
    parts = [sun_irradiance(scene.caster, xyz, normals, scene.lighting, rng) for _ in range(16)]
    sun = np.mean(parts, axis=0)[:, None] * np.asarray(scene.lighting.sun, np.float32)
    return scene.pattern(xyz) * (sun + sky)


def _stone(
    scene: Scene, camera: Camera, samples: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """(h, w, 3) light of the piece times its coverage, and (h, w) coverage in 0..1."""
    size = (camera.height, camera.width)
    light, coverage = np.zeros((*size, 3), np.float32), np.zeros(size, np.float32)
    worth = np.flatnonzero(_worth_a_ray(scene, camera))
    offsets = [(k + 0.5) / samples for k in range(samples)]
    for dx, dy in ((x, y) for y in offsets for x in offsets):
        rays = lens.directions(camera.intrinsics, dx, dy).reshape(-1, 3)
        for part in (worth[i : i + CHUNK] for i in range(0, len(worth), CHUNK)):
            color, found = _seen(scene, camera, rays[part], rng)
            light.reshape(-1, 3)[part[found]] += color
            coverage.reshape(-1)[part[found]] += 1
    share = np.float32(1 / samples**2)
    return light * share, coverage * share


def _seen(
    scene: Scene, camera: Camera, rays_in_cam: Floats, rng: np.random.Generator
) -> tuple[Floats, NDArray[np.bool_]]:
    """(m, 3) light along those of the (n, 3) rays that meet the piece, and (n,) which do."""
    center = (camera.center - scene.origin).astype(np.float32)
    rays = rays_in_cam @ camera.pose.R.astype(np.float32)
    hits = scene.caster.first_hits(np.broadcast_to(center, rays.shape), rays)
    seen = rays[hits.found]
    xyz = center + seen * hits.distance[:, None]
    here = scene.caster.at(hits, scene.surface)
    normals, sky = unit(here[:, :3]), here[:, 3:]
    sun = sun_irradiance(scene.caster, xyz, normals, scene.lighting, rng)[:, None]
    sun = sun * np.asarray(scene.lighting.sun, np.float32)
    color = scene.pattern(xyz) * (sun + sky)
    if scene.gloss:
        color += sun * _highlight(normals, -seen, scene)[:, None]
    return color, hits.found


def _highlight(normals: Floats, to_eye: Floats, scene: Scene) -> Floats:
    """(n,) mirrored share of the sun: GGX distribution (Walter et al. 2007, eq. 33) with
    F0 = 0.04 and the visibility term 1/4 (Kelemen), per unit of matte white.
    """
    half = unit(to_eye + scene.lighting.to_sun)
    cosine = np.maximum(np.einsum("ij,ij->i", normals, half), 0)
    a2 = np.float32(scene.roughness**4)
    spread = a2 / (cosine**2 * (a2 - 1) + 1) ** 2
    return scene.gloss * 0.04 * spread / 4


def _worth_a_ray(scene: Scene, camera: Camera) -> NDArray[np.bool_]:
    """(h, w) pixels that may show the piece: the hull of its image, and a margin of 1 % of the
    longer side, since the lens bends the hull's straight edges.
    """
    everything = np.ones((camera.height, camera.width), bool)
    xy, _ = camera.project(scene.hull + scene.origin)
    if not np.isfinite(xy).all() or np.abs(xy).max() > 1e5:
        return everything
    margin = 2 + round(0.01 * max(camera.width, camera.height))
    hull = cv2.convexHull(np.round(xy).astype(np.int32))
    inside = cv2.fillConvexPoly(everything.astype(np.uint8) * 0, hull, 1)
    return cv2.dilate(inside, np.ones((2 * margin + 1,) * 2, np.uint8)).astype(bool)


def _behind(scene: Scene, camera: Camera, how: ShotOptions, share: Floats) -> Floats:
    """(h, w, 3) light from whatever is not the piece, times its (h, w) share of each pixel."""
    free = share > 0
    rays = lens.directions(camera.intrinsics)[free] @ camera.pose.R.astype(np.float32)
    if how.background == "garden":
        center = (camera.center - scene.origin).astype(np.float32)
        light = backdrop.garden(rays, center, scene.caster, scene.lighting, how.seed)
    else:
        light = {"gradient": backdrop.gradient, "wall": backdrop.wall}[how.background](rays)
    out = np.zeros((*share.shape, 3), np.float32)
    out[free] = light * share[free][:, None]
    return out
