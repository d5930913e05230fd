"""Photographs of a carved piece by casting rays: an image maker that shares nothing with the
renderer under test but the definition of a camera.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.demo import backdrop, lens
from texproj.demo.caster import Caster
from texproj.demo.light import Lighting, sky_irradiance, smoothed, sun_irradiance, unit
from texproj.demo.pattern import Pattern
from texproj.demo.sensor import Sensor, defocused, developed
from texproj.demo.visitor import in_front
from texproj.mesh import Mesh, vertex_normals

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Scene:
    """A piece in its place, lit. Local frame = world minus `origin`.

    normals, sky: (V, 3) float32 per vertex of the caster's mesh; gloss: strength of the
    highlight (0 matte, 1 polished), roughness: of its microfacets.
    """

    caster: Caster
    normals: Floats
    sky: Floats
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
    mesh: Mesh, pattern: Pattern, lighting: Lighting, gloss: float = 0.0, sky_rays: int = 32,
    origin: NDArray[np.float64] | None = None,
) -> Scene:  # fmt: skip
    """The scene with sky light computed once for all photos; mesh in world coordinates."""
    place = np.zeros(3) if origin is None else np.asarray(origin, np.float64)
    caster = Caster(mesh, place)
    normals = vertex_normals(mesh).astype(np.float32)
    sky = sky_irradiance(caster, caster.vertices, normals, lighting, sky_rays)
    return Scene(caster, normals, smoothed(sky, caster.faces), pattern, lighting, place, gloss)


def photograph(scene: Scene, camera: Camera, options: ShotOptions | None = None) -> Shot:
    """One photo: rays through the full lens model, then defocus, vignetting and the sensor."""
    how = options or ShotOptions()
    rng = np.random.default_rng([how.seed, 3])
    stone, coverage = _stone(scene, camera, how.samples, rng)
    light = stone + (1 - coverage)[..., None] * _behind(scene, camera, how)
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
    light = np.zeros((camera.height, camera.width, 3), np.float32)
    coverage = np.zeros((camera.height, camera.width), np.float32)
    window = _window(scene, camera)
    offsets = (np.arange(samples) + 0.5) / samples
    for dx, dy in ((float(x), float(y)) for y in offsets for x in offsets):
        rays = lens.directions(camera.intrinsics, dx, dy)[window]
        color, found = _seen(scene, camera, rays.reshape(-1, 3), rng)
        hit = found.reshape(rays.shape[:2])
        light[window][hit] += color
        coverage[window] += hit
    return light / samples**2, coverage / samples**2


def _seen(
    scene: Scene, camera: Camera, rays_in_cam: Floats, rng: np.random.Generator
) -> tuple[Floats, NDArray[np.bool_]]:
    """(m, 3) light along those of the (n, 3) rays that meet the piece, and (n,) which do."""
    center = (camera.center - scene.origin).astype(np.float32)
    rays = rays_in_cam @ camera.pose.R.astype(np.float32)
    hits = scene.caster.first_hits(np.broadcast_to(center, rays.shape), rays)
    seen = rays[hits.found]
    xyz = center + seen * hits.distance[:, None]
    normals = unit(scene.caster.at(hits, scene.normals))
    sun = sun_irradiance(scene.caster, xyz, normals, scene.lighting, rng)[:, None]
    sun = sun * np.asarray(scene.lighting.sun, np.float32)
    color = scene.pattern(xyz) * (sun + scene.caster.at(hits, scene.sky))
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


def _window(scene: Scene, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns outside of which no ray can meet the piece."""
    low, high = scene.caster.vertices.min(0), scene.caster.vertices.max(0)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    xy, _ = camera.project(corners + scene.origin)
    if not np.isfinite(xy).all():
        return slice(0, camera.height), slice(0, camera.width)
    size = (camera.width, camera.height)
    margin = 0.05 * max(size)  # the lens bends the straight edges of the box
    x0, y0 = np.clip(np.floor(xy.min(0) - margin), 0, size).astype(int)
    x1, y1 = np.clip(np.ceil(xy.max(0) + margin), 0, size).astype(int)
    return slice(y0, y1), slice(x0, x1)


def _behind(scene: Scene, camera: Camera, how: ShotOptions) -> Floats:
    """(h, w, 3) light from whatever is not the piece."""
    rays = lens.directions(camera.intrinsics).reshape(-1, 3) @ camera.pose.R.astype(np.float32)
    paint = {"garden": backdrop.garden, "gradient": backdrop.gradient, "wall": backdrop.wall}
    light = paint[how.background](rays, how.seed)
    center = (camera.center - scene.origin).astype(np.float32)
    if how.background == "garden" and center[2] > 0:
        down = np.flatnonzero(rays[:, 2] < -1e-3)
        far = -center[2] / rays[down, 2]
        ground = center + rays[down] * far[:, None]
        ground[:, 2] = 0
        haze = np.exp(-far / backdrop.HAZE_METRES)[:, None]
        gravel = backdrop.court(scene.caster, ground, scene.lighting, how.seed // 1000)
        light[down] = gravel * haze + (1 - haze) * light[down]
    return light.reshape(camera.height, camera.width, 3)
