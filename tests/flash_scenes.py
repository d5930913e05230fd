"""Photographs by Mitsuba of pieces in a dark room, a flash beside the camera, all known.

Nothing of it is shared with what is tested: light bounces until it is gone, the surface is Disney's
principled one, its roughness is on no grid, photos have noise and 8 bits, each flash has an output
of its own, and the scan is not the shape that was photographed. Needs `pip install mitsuba`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from appearance_scenes import (
    DEPTH,
    DISTANCE,
    FIELD_DEG,
    SIZE,
    VARIANT,
    developed,
    knots,
    sensor,
)

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera, Intrinsics, Pose
from texproj.demo.noise import noise
from texproj.demo.object import carved, piece, scanned
from texproj.mesh import Mesh, face_areas, vertex_normals

LAMP = (0.09, -0.11, 0.02)
"""Where the flash is, metres right of the lens, below and in front of it: 4 degrees apart."""

OUTPUT = 0.15
"""Half of the range of the flashes' output."""

SHOT_SAMPLES, SHOT_SEEDS = 32, (900, 2900)
"""Of the photos that are held out, each drawn twice: paths per pixel, and the first one's random
numbers.
"""


@dataclass(frozen=True)
class Material:
    """What a part of the piece is made of. rgb: linear; varied: how much its brightness varies."""

    rgb: tuple[float, float, float]
    roughness: float
    metallic: float = 0.0
    varied: float = 0.08


MATERIALS = {
    "gilded": (
        Material((0.60, 0.53, 0.43), 0.83, varied=0.2),
        Material((0.06, 0.15, 0.36), 0.37),
        Material((0.90, 0.65, 0.30), 0.52, 1.0, 0.04),
    ),
    "glazed": (
        Material((0.45, 0.22, 0.13), 0.72, varied=0.15),
        Material((0.10, 0.24, 0.11), 0.28),
        Material((0.93, 0.58, 0.45), 0.43, 1.0, 0.04),
    ),
    "lacquered": (
        Material((0.016, 0.015, 0.019), 0.33, varied=0.1),
        Material((0.52, 0.33, 0.09), 0.66, varied=0.12),
        Material((0.86, 0.80, 0.70), 0.47, 1.0, 0.04),
    ),
}
"""Lacquer that is as black as a metal looks off its highlight, beside one."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Of n points: base (n, 3) linear, roughness (n,), metallic (n,), kind (n,) number."""

    base: Floats
    roughness: Floats
    metallic: Floats
    kind: np.ndarray


Pair = tuple[Floats, Floats]
"""Two pictures (h, w, 3) of the same, linear, by random numbers of their own."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A photo that is not in the set. lamp: (3,) in the world, of an intensity; drawn: twice, by
    random numbers of their own; shown: (h, w) where it shows the piece.
    """

    camera: Camera
    lamp: Doubles
    intensity: float
    drawn: Pair

    @property
    def shown(self) -> np.ndarray:
        return (self.drawn[0] + self.drawn[1]).max(axis=2) > 0


@dataclass(frozen=True, eq=False)
class FlashSet:
    """mesh: the scan; cameras and (h, w, 3) uint8 photos by name; output: of each flash, of which
    the lamp's intensity is a multiple; truth: at the scan's vertices; flash and lamp: photos held
    out, lit by the flash and from elsewhere.
    """

    mesh: Mesh
    cameras: dict[str, Camera]
    photos: dict[str, np.ndarray]
    output: Doubles
    intensity: float
    truth: Truth
    flash: list[Shot]
    lamp: list[Shot]


def flash_set(
    kind: Literal["stele", "capital", "knot"],
    materials: str,
    photos: int = 36,
    samples: int = 16,
    seed: int = 3,
    exact: bool = False,
) -> FlashSet:
    """One set; deterministic but for the renderer's rounding. exact: the scan is the shape that is
    photographed, of 54,000 faces; else it has 40,000 of other places, 0.4 mm off, of 120,000.
    """
    true, scan = knots(seed) if kind == "knot" else _pieces(kind, seed, exact)
    intensity = 0.55 * np.pi * (DISTANCE * scan.diagonal) ** 2
    room = DarkRoom(true, truth_at(true.vertices, materials, seed))
    rng = np.random.default_rng(seed)
    output = rng.uniform(1 - OUTPUT, 1 + OUTPUT, photos)
    cameras, pictures = {}, {}
    for number, camera in enumerate(all_over(scan, photos, seed)):
        name = f"IMG_{number:03d}.png"
        lamp = camera.pose.inverse.apply([LAMP])[0]
        radiance = room.taken(camera, lamp, intensity * output[number], samples, number)
        cameras[name], pictures[name] = camera, developed(radiance, seed * 100 + number)
    others = all_over(scan, 6, seed + 50)
    flash, lamp = [], []
    for number, camera in enumerate(others):
        beside = camera.pose.inverse.apply([LAMP])[0]
        elsewhere = others[(number + 3 * (number % 2) + 1) % 6].center
        elsewhere = scan.center + 0.6 * (elsewhere - scan.center) + 0.4 * (beside - scan.center)
        for shots, at in ((flash, beside), (lamp, elsewhere)):
            power = intensity * (np.linalg.norm(at - scan.center) / DISTANCE / scan.diagonal) ** 2
            shots.append(Shot(camera, at, power, room.twice(camera, at, power, number)))
    truth = as_pixels_show(scan, materials, seed)
    return FlashSet(scan, cameras, pictures, output, intensity, truth, flash, lamp)


def _pieces(kind: Literal["stele", "capital"], seed: int, exact: bool) -> tuple[Mesh, Mesh]:
    """What is photographed, and its scan."""
    made = piece(kind, seed)
    true = carved(made, 54_000 if exact else 120_000)
    return true, true if exact else scanned(made, 40_000, 0.0004, seed)


def all_over(mesh: Mesh, photos: int, seed: int) -> list[Camera]:
    """Cameras all around and above, some from below: highlights are seen where a photo looks
    straight on.
    """
    rng = np.random.default_rng(seed)
    w, h = SIZE
    f = w / 2 / np.tan(np.radians(FIELD_DEG) / 2)
    out = []
    for k in range(photos):
        height = 0.97 - 1.3 * (k + 0.5) / photos
        azimuth = k * np.pi * (3 - np.sqrt(5)) + rng.uniform(-0.2, 0.2)
        across = np.sqrt(1 - height**2)
        toward = np.array([across * np.cos(azimuth), across * np.sin(azimuth), height])
        pose = Pose.look_at(mesh.center + toward * mesh.diagonal * DISTANCE, mesh.center)
        out.append(Camera(Intrinsics(w, h, f, f, w / 2, h / 2), pose))
    return out


def truth_at(xyz: Any, materials: str, seed: int) -> Truth:
    """What the piece is made of at points (n, 3)."""
    xyz = np.asarray(xyz, np.float32)
    made = MATERIALS[materials]
    kind = np.where(
        waves(xyz, 0.5, seed) > 0.5, 1, np.where(waves(xyz, 0.45, seed + 9) > 0.5, 2, 0)
    )
    fine = (
        1
        + noise(xyz, 0.05, seed + 43, 1.2)[:, None]
        * np.array([m.varied for m in made], np.float32)[kind][:, None]
    )
    base = np.array([m.rgb for m in made], np.float32)[kind] * fine
    roughness, metallic = (
        np.array([getattr(m, name) for m in made], np.float32)[kind]
        for name in ("roughness", "metallic")
    )
    return Truth(np.clip(base, 0.01, 0.95), roughness, metallic, kind)


def waves(xyz: Floats, length: float, seed: int) -> Floats:
    """(n,) a smooth function of points (n, 3), about -1..1."""
    rng = np.random.default_rng(seed)
    toward = rng.standard_normal((5, 3))
    toward *= 2 * np.pi / length / np.linalg.norm(toward, axis=1, keepdims=True)
    return np.sin(xyz @ toward.T + rng.uniform(0, 6, 5)).sum(axis=1) / 1.6


def as_pixels_show(mesh: Mesh, materials: str, seed: int) -> Truth:
    """The truth of the scan's vertices, base colors averaged over what a pixel shows, of the
    level of the photo whose pixels are as large as a vertex is wide.
    """
    pixel = DISTANCE * mesh.diagonal * 2 * np.tan(np.radians(FIELD_DEG) / 2) / SIZE[0]
    spacing = np.sqrt(face_areas(mesh).sum() / len(mesh.vertices))
    width = pixel * 2 ** max(0, np.round(np.log2(spacing / pixel)))
    rng = np.random.default_rng(1)
    here = truth_at(mesh.vertices, materials, seed)
    total, count = np.zeros(mesh.vertices.shape), np.zeros(len(mesh.vertices))
    for _ in range(16):
        aside = mesh.vertices + rng.standard_normal(mesh.vertices.shape) * 0.6 * width
        there = truth_at(aside, materials, seed)
        same = there.kind == here.kind
        total += there.base * same[:, None]
        count += same
    base = np.where(count[:, None] > 4, total / np.maximum(count, 1)[:, None], here.base)
    return Truth(base.astype(np.float32), here.roughness, here.metallic, here.kind)


class DarkRoom:
    """A piece and one point of light, by Mitsuba."""

    def __init__(self, mesh: Mesh, truth: Truth, specular: float = 0.5) -> None:
        import mitsuba as mi

        mi.set_variant(VARIANT)
        self._mi = mi
        self._scene = mi.load_dict({
            "type": "scene",
            "integrator": {"type": "path", "max_depth": DEPTH},
            "piece": _shape(mi, mesh, truth, specular),
            "lamp": {"type": "point", "position": [0, 0, 0], "intensity": 1.0},
        })  # fmt: skip
        self._parameters = mi.traverse(self._scene)

    def taken(
        self, camera: Camera, lamp: Doubles, intensity: float, samples: int, seed: int
    ) -> Floats:
        """(h, w, 3) linear radiance."""
        mi, parameters = self._mi, self._parameters
        parameters["lamp.position"] = [float(x) for x in lamp]
        parameters.update()
        made = mi.render(self._scene, sensor=sensor(mi, camera, samples), spp=samples, seed=seed)
        return np.nan_to_num(np.array(made)[..., :3]) * np.float32(intensity)

    def twice(self, camera: Camera, lamp: Doubles, intensity: float, number: int) -> Pair:
        """The same as a held-out photo of a number."""
        one, other = (
            self.taken(camera, lamp, intensity, SHOT_SAMPLES, seed + number) for seed in SHOT_SEEDS
        )
        return one, other


def _shape(mi: Any, mesh: Mesh, truth: Truth, specular: float) -> Any:
    properties = mi.Properties()

    def attribute(name: str) -> dict[str, str]:
        return {"type": "mesh_attribute", "name": f"vertex_{name}"}

    properties["bsdf"] = mi.load_dict({
        "type": "twosided",
        "inner": {
            "type": "principled", "specular": specular,
            "base_color": attribute("color"), "roughness": attribute("roughness"),
            "metallic": attribute("metallic"),
        },
    })  # fmt: skip
    count = len(mesh.vertices), len(mesh.faces)
    shape = mi.Mesh("piece", *count, props=properties, has_vertex_normals=True)
    shape.add_attribute("vertex_color", 3, truth.base.ravel().astype(np.float32))
    shape.add_attribute("vertex_roughness", 1, truth.roughness.astype(np.float32))
    shape.add_attribute("vertex_metallic", 1, truth.metallic.astype(np.float32))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    parameters["vertex_normals"] = vertex_normals(mesh).astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    return shape
