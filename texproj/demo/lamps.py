"""Synthetic projects whose light is to be found: a flash, a sky and a sun, or a turntable."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera, Pose
from texproj.demo.jpeg import Exif, jpeg
from texproj.demo.light import Lighting
from texproj.demo.make import DemoPhoto, DemoProject, true_colors
from texproj.demo.noise import noise
from texproj.demo.object import carved, piece, scanned
from texproj.demo.pattern import Pattern, painted
from texproj.demo.photographer import ShotOptions, photograph, set_up
from texproj.demo.sensor import Sensor, developed
from texproj.demo.studio import Lamp, Made, Studio, Stuff
from texproj.demo.views import COMPACT
from texproj.mesh import Mesh
from texproj.options import DemoLight

STONE, PAINT, GOLD = Stuff(0.55, grain=0.7), Stuff(0.16, grain=0.2), Stuff(0.22, metal=True)
GILT = (0.90, 0.66, 0.32)
FLASH_PLACE = (0.09, -0.11, 0.02)
"""Of the flash from the lens, metres: to its right, above it, in front of it."""

OUTPUT = 0.12
"""Half of the range of the flashes' output."""

DISTANCE = 1.55
"""Of the cameras from the piece's middle, in its diagonals."""

STUDIO = replace(COMPACT, name="Demo Studio", focal=1.3)
SEED = 4
LONG_SIDE = 480
FACES, CARVED_FACES = 40_000, 90_000
SCAN_NOISE = 0.0003
"""Metres."""

PHOTOS = {"flash": 24, "natural": 16, "turntable": 24}
SUN_AND_SKY = Lighting()


@dataclass(frozen=True)
class DemoSize:
    """How much is made: tests make less."""

    photos: int
    long_side: int = LONG_SIDE
    faces: int = FACES
    carved_faces: int = CARVED_FACES


def make_lit_demo(
    light: DemoLight, size: DemoSize | None = None, progress: Callable[[str], None] = lambda _: None
) -> DemoProject:
    """A capital in a light that is to be found, with its true cameras."""
    size = size or DemoSize(PHOTOS[light])
    progress("carving the stone")
    made = piece("capital", SEED)
    true = carved(made, size.carved_faces)
    scan = scanned(made, size.faces, SCAN_NOISE, SEED)
    pattern = gilded if light == "flash" else painted(SEED)
    take = {"flash": _by_flash, "natural": _in_nature, "turntable": _on_turntable}[light]
    shoot = take(true, pattern)
    photos = []
    for number in range(size.photos):
        progress(f"taking photo {number + 1} of {size.photos}")
        photos.append(shoot(scan, number, size))
    scene = set_up(true, pattern, SUN_AND_SKY, sky_rays=1)
    albedo, shown = true_colors(scene, scan)
    return DemoProject(scan, tuple(photos), albedo, shown)


def light_settings(light: DemoLight) -> str:
    """What project.toml says of the light; cameras that are exact are left as they are."""
    lamp = f"position = {list(FLASH_PLACE)}\n" if light == "flash" else ""
    return f'\n[light]\nkind = "{light}"\n{lamp}\n[refine]\nenabled = false\n'


def gilded(xyz: Floats) -> Floats:
    """(n, 3) base colors: the painted stone, some of it gilded."""
    return np.where(_is_gold(xyz)[:, None], np.asarray(GILT, np.float32), painted(SEED)(xyz))


def _is_gold(xyz: Floats) -> np.ndarray:
    return noise(xyz, 0.35, SEED + 51, 3.0) > np.float32(0.7)


def _made_of(xyz: Floats, pattern: Pattern) -> Made:
    """Strong colors are paint, the rest is stone."""
    base = pattern(xyz)
    strong = base.min(axis=1) < 0.45 * base.max(axis=1)
    kind = strong.astype(np.intp)
    return Made(base, np.where(_is_gold(xyz), 2, kind) if pattern is gilded else kind)


def _studio(true: Mesh, pattern: Pattern) -> Studio:
    return Studio(true, (STONE, PAINT, GOLD), partial(_made_of, pattern=pattern))


Shoot = Callable[[Mesh, int, DemoSize], DemoPhoto]


def _by_flash(true: Mesh, pattern: Pattern) -> Shoot:
    """Cameras all over, a flash on each, of an output of its own, nothing else."""
    studio = _studio(true, pattern)

    def shoot(scan: Mesh, number: int, size: DemoSize) -> DemoPhoto:
        rng = np.random.default_rng([SEED, number, 43])
        height = 0.95 - 1.15 * (number + 0.5) / size.photos
        camera = _camera(scan, number * np.pi * (3 - np.sqrt(5)), np.arcsin(height), size, rng)
        place = camera.pose.inverse.apply([FLASH_PLACE])[0]
        power = 0.6 * (DISTANCE * scan.diagonal) ** 2 * rng.uniform(1 - OUTPUT, 1 + OUTPUT)
        lamp = Lamp(place, 0.015, (power, power, power))
        return _developed(studio.photographed(camera, [lamp], np.zeros(3), number), camera, number)

    return shoot


def _on_turntable(true: Mesh, pattern: Pattern) -> Shoot:
    """Two rounds from two heights; a soft lamp to the left, a weaker, cooler one to the right, and
    what the walls send back.
    """
    studio = _studio(true, pattern)

    def shoot(scan: Mesh, number: int, size: DemoSize) -> DemoPhoto:
        rng = np.random.default_rng([SEED, number, 47])
        turn = 2 * np.pi * (number + 0.5 * (number % 2)) / size.photos
        camera = _camera(scan, turn, np.radians((14, 38)[number % 2]), size, rng)
        d = scan.diagonal
        lamps = [
            Lamp(scan.center + _toward(turn - 0.85, 0.7) * 1.9 * d, 0.3 * d, _power(1.9 * d, 0.95)),
            Lamp(scan.center + _toward(turn + 1.1, 0.25) * 1.6 * d, 0.4 * d, _power(1.6 * d, 0.32)),
        ]
        room = np.array([0.13, 0.123, 0.11])
        return _developed(studio.photographed(camera, lamps, room, number), camera, number)

    return shoot


def _power(distance: float, irradiance: float) -> tuple[float, float, float]:
    power = irradiance * distance**2
    return power, 0.93 * power, 0.82 * power


def _in_nature(true: Mesh, pattern: Pattern) -> Shoot:
    """All around, in the sun and sky of the demo, by its photographer."""
    scene = set_up(true, pattern, SUN_AND_SKY, gloss=0.3)

    def shoot(scan: Mesh, number: int, size: DemoSize) -> DemoPhoto:
        rng = np.random.default_rng([SEED, number, 53])
        turn = 2 * np.pi * number / size.photos
        camera = _camera(scan, turn, np.radians((10, 34, 58)[number % 3]), size, rng)
        how = ShotOptions(sensor=Sensor(), vignetting=0, seed=number)
        shot = photograph(scene, camera, how)
        return _photo(shot.pixels, shot.object_mask, camera, number)

    return shoot


def _toward(azimuth: float, elevation: float) -> Doubles:
    """(3,) unit vector from the piece, z upwards."""
    return np.array([
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation),
    ])  # fmt: skip


def _camera(
    scan: Mesh, azimuth: float, elevation: float, size: DemoSize, rng: np.random.Generator
) -> Camera:
    """A camera that looks at the piece, not quite at its middle."""
    lens = STUDIO.intrinsics(size.long_side, round(size.long_side * 0.75))
    aim = scan.center + rng.normal(0, 0.01, 3) * scan.diagonal
    eye = aim + _toward(azimuth, elevation) * DISTANCE * scan.diagonal
    return Camera(lens, Pose.look_at(eye, aim))


def _developed(light: Floats, camera: Camera, number: int) -> DemoPhoto:
    rng = np.random.default_rng([SEED, number, 59])
    mask = np.where(light.max(axis=2) > 0, 255, 0).astype(np.uint8)
    return _photo(developed(light, Sensor(), rng), mask, camera, number)


def _photo(pixels: np.ndarray, mask: np.ndarray, camera: Camera, number: int) -> DemoPhoto:
    encoded = jpeg(pixels, Exif(STUDIO, 0.0, number, turned=False), quality=95)
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return DemoPhoto(f"IMG_{number + 1:04d}.jpg", encoded, closed, camera)
