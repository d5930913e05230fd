"""Small synthetic scenes with known truth, shared by all tests and made once per session; photos,
once for all processes that run tests.

The photos come from texproj.demo's ray caster, which shares nothing with the renderers under
test but the definition of a camera. Each function is cached: do not edit what it returns.
"""

import hashlib
import os
import pickle
from dataclasses import dataclass, replace
from functools import lru_cache, wraps
from pathlib import Path

import numpy as np
from filelock import FileLock

from texproj.camera import Camera
from texproj.demo.light import Lighting
from texproj.demo.make import true_colors
from texproj.demo.object import carved, piece, scanned
from texproj.demo.pattern import painted, uniform
from texproj.demo.photographer import Scene, ShotOptions, photograph, set_up
from texproj.demo.sensor import Sensor
from texproj.demo.views import View, camera_at
from texproj.mesh import Mesh
from texproj.photo import Photo, PhotoInfo

KEPT = "TEXPROJ_TEST_SCENES"
"""Environment variable: the folder where processes that run tests keep photos for each other."""
PAIR = (View(-12, 14, upright=False), View(28, 20, upright=False), View(-50, 10, upright=False))
ROUND = tuple(View(a, e, upright=False) for a, e in
              ((-40, 12), (-25, 30), (-10, 15), (5, 40), (15, 12), (30, 28), (45, 15)))  # fmt: skip


@dataclass(frozen=True, eq=False)
class Synthetic:
    """mesh: the scan, world; photos and their true cameras; masks: (h, w) uint8, 255 = the piece;
    albedo, shaded: (V, 3) linear, true paint and light sent out at EV 0 without highlights;
    exposure: gain of each photo against EV 0; steady: (V,) bool, vertices around which the true
    light changes little, away from creases, shadow borders and sharp paint.
    """

    mesh: Mesh
    photos: tuple[Photo, ...]
    cameras: tuple[Camera, ...]
    masks: tuple[np.ndarray, ...]
    albedo: np.ndarray
    shaded: np.ndarray
    exposure: tuple[float, ...]
    steady: np.ndarray


def kept(make):
    """What `make` gives, by its arguments: made by one process, read by the others."""

    @lru_cache(maxsize=8)
    @wraps(make)
    def found(*given, **named):
        folder = os.environ.get(KEPT)
        if folder is None:
            return make(*given, **named)
        asked = repr((make.__name__, given, sorted(named.items())))
        path = Path(folder, hashlib.sha256(asked.encode()).hexdigest())
        with FileLock(f"{path}.lock"):
            if not path.exists():
                path.write_bytes(pickle.dumps(make(*given, **named)))
            return pickle.loads(path.read_bytes())

    return found


@lru_cache(maxsize=4)
def scene_of(kind: str = "stele", seed: int = 0, matte: bool = False, gloss: float = 0.0) -> Scene:
    """The lit piece, 80 k faces."""
    pattern = uniform(0.55) if matte else painted(seed)
    return set_up(carved(piece(kind, seed), 80_000), pattern, Lighting(), gloss, sky_rays=24)


@lru_cache(maxsize=4)
def scan_of(kind: str = "stele", seed: int = 0, faces: int = 20_000) -> Mesh:
    """The piece as scanned, 0.4 mm noise."""
    return scanned(piece(kind, seed), faces, 0.0004, seed)


HAZY = Lighting(sun=(0.6, 0.54, 0.46), sun_disk_deg=4.0, sky=(0.44, 0.48, 0.54))
"""A veiled sun: soft shadows, so that true colors do not jump from vertex to vertex."""


def taken(
    scene: Scene, scan: Mesh, views, shots, long_side: int, seed: int = 0, footprint: float = 0.0
) -> Synthetic:
    """Photos of a scene from views, each with its own ShotOptions; true colors averaged over a
    footprint of that deviation in metres.
    """
    photos, cameras, masks = [], [], []
    for i, (view, how) in enumerate(zip(views, shots, strict=True)):
        camera = camera_at(view, scan.bounds, long_side, np.random.default_rng([seed, i, 51]))
        shot = photograph(scene, camera, replace(how, seed=seed * 1000 + i))
        info = PhotoInfo(
            f"{i + 1:04d}.jpg", camera.width, camera.height, round(camera.intrinsics.fx, -1),
            view.body.name, exposure_ev=how.sensor.ev,
        )  # fmt: skip
        photos.append(Photo(info, shot.pixels))
        cameras.append(camera)
        masks.append(shot.object_mask)
    albedo, shaded = true_colors(scene, scan, footprint)
    gains = tuple(2.0**how.sensor.ev for how in shots)
    steady = np.ones(len(shaded), bool)
    if footprint:
        around = true_colors(scene, scan, 3 * footprint)[1]
        steady = (np.abs(around - shaded) < 0.05 * shaded + 0.005).all(axis=1)
    return Synthetic(
        scan, tuple(photos), tuple(cameras), tuple(masks), albedo, shaded, gains, steady
    )


@kept
def synthetic_pair(
    photos: int = 2, kind: str = "stele", seed: int = 0, faces: int = 20_000, long_side: int = 480
) -> Synthetic:
    """1 to 3 photos of a painted piece; kind "stele" or "capital", each seed another piece."""
    shots = [ShotOptions()] * photos
    scene, scan = scene_of(kind, seed), scan_of(kind, seed, faces)
    return taken(scene, scan, PAIR[:photos], shots, long_side, seed)


@kept
def matte_pair(
    photos: int = 1, kind: str = "stele", seed: int = 0, faces: int = 20_000, long_side: int = 480
) -> Synthetic:
    """Photos of a uniform matte piece: shadows and noise, but no paint; plain background."""
    shots = [ShotOptions(background="gradient", sensor=Sensor(full_well=4000))] * photos
    scene, scan = scene_of(kind, seed, matte=True), scan_of(kind, seed, faces)
    return taken(scene, scan, PAIR[:photos], shots, long_side, seed)


@dataclass(frozen=True)
class Defects:
    """What is wrong with the photos of `exposure_round`; each can be switched off."""

    exposure: bool = True
    vignetting: bool = True
    visitor: bool = True
    defocus: bool = True
    highlight: bool = True


NO_DEFECTS = Defects(False, False, False, False, False)


@lru_cache(maxsize=2)
def round_scene(kind: str = "stele", seed: int = 0) -> Scene:
    """The glossy piece under a veiled sun of which `exposure_round` takes photos."""
    return set_up(carved(piece(kind, seed), 120_000), painted(seed), HAZY, gloss=0.8)


@kept
def exposure_round(
    kind: str = "stele", seed: int = 0, faces: int = 40_000, long_side: int = 720,
    defects: Defects = Defects(),
) -> Synthetic:  # fmt: skip
    """Seven photos of the front for color: exposure steps up to 1 EV either way, vignetting, a
    highlight in all, somebody in front in the third (index 2), the sixth (index 5) out of focus.

    True colors are averaged over 0.45 of a pixel, as good sampling of the photos would give them.
    """
    steps = (0.0, -1.0, 0.0, 0.5, 1.0, 0.0, -0.5) if defects.exposure else (0.0,) * 7
    loss = 0.35 if defects.vignetting else 0.0
    shots = [ShotOptions(sensor=Sensor(ev=ev), vignetting=loss) for ev in steps]
    shots[2] = replace(shots[2], visitor=defects.visitor)
    shots[5] = replace(shots[5], defocus_px=4.0 if defects.defocus else 0.0)
    scene, scan = round_scene(kind, seed), scan_of(kind, seed, faces)
    if not defects.highlight:
        scene = replace(scene, gloss=0.0)
    # A pixel of the 720 is 2.8 mm wide on the piece.
    return taken(scene, scan, ROUND, shots, long_side, seed, 0.45 * 0.0028 * 720 / long_side)
