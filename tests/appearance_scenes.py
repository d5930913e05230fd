"""Photographs by Mitsuba, a path tracer of other hands, in natural light with everything known.

Nothing of it is shared with what is tested: the light is a sky and a sun disk that bounces until it
is gone, the surface is Disney's principled one, the photos have noise and 8 bits, and the scan is
not the shape that was photographed. Needs `pip install mitsuba`.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera, Intrinsics, Pose
from texproj.demo.object import Piece, carved, piece, scanned
from texproj.demo.pattern import Pattern, painted
from texproj.mesh import Mesh, face_areas, vertex_normals
from texproj.photo import srgb_from_linear

VARIANT = os.environ.get("MITSUBA_VARIANT", "scalar_rgb")
"""On all cores; the vectorized llvm_ad_rgb is faster and wants an LLVM of 16 or later."""

DEPTH = 6
"""Longest path: five bounces."""

SIZE = (480, 360)
SKY_SIZE = (128, 64)
FIELD_DEG = 40.0
DISTANCE = 1.5
"""Of the cameras, in diagonals of the piece."""

Weather = Literal["sun", "cloudy"]


@dataclass(frozen=True)
class Light:
    """A day. sun: irradiance square to it, over pi; tint: color of the sky; azimuth, elevation: of
    the sun, degrees, z upwards.
    """

    sun: tuple[float, float, float]
    sky: tuple[float, float, float]
    ground: tuple[float, float, float]
    azimuth_deg: float = -118.0
    elevation_deg: float = 38.0

    @property
    def to_sun(self) -> Doubles:
        """(3,) unit direction."""
        a, e = np.radians(self.azimuth_deg), np.radians(self.elevation_deg)
        return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


DAYS = {
    "sun": Light((0.90, 0.82, 0.70), (0.20, 0.25, 0.33), (0.10, 0.09, 0.07)),
    "cloudy": Light((0.0, 0.0, 0.0), (0.78, 0.84, 0.95), (0.22, 0.20, 0.17)),
}


@dataclass(frozen=True, eq=False)
class Set:
    """mesh: the scan; albedo: (V, 3) float32 linear, true at its vertices; cameras and (h, w, 3)
    uint8 photos by name; light: the day; true: the shape that was photographed.
    """

    mesh: Mesh
    albedo: Floats
    cameras: dict[str, Camera]
    photos: dict[str, np.ndarray]
    light: Light
    true: Mesh


def natural_set(
    kind: Literal["stele", "capital"],
    weather: Weather,
    photos: int = 12,
    samples: int = 16,
    gold: bool = False,
    seed: int = 3,
) -> Set:
    """One set; deterministic but for the renderer's rounding. The capital has its own 54,000 faces,
    the stele is a scan of 40,000 faces of other places, 0.4 mm off, of 120,000.
    """
    import mitsuba as mi

    mi.set_variant(VARIANT)
    made = piece(kind, seed)
    true, scan = _shapes(kind, made, seed)
    pattern = _gold if gold else painted(seed)
    light = DAYS[weather]
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH},
        "piece": _shape(mi, true, pattern(true.vertices.astype(np.float32)), gold),
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(sky_image(light)), "scale": 1.0},
    })  # fmt: skip
    cameras, pictures = {}, {}
    for number, camera in enumerate(all_around(scan, photos, seed)):
        name = f"IMG_{number:03d}.png"
        radiance = _taken(mi, scene, camera, samples, number)
        cameras[name], pictures[name] = camera, developed(radiance, seed * 100 + number)
    albedo = as_pixels_show(pattern, scan)
    return Set(scan, albedo, cameras, pictures, light, true)


def turntable_set(
    kind: Literal["stele", "capital"], photos: int = 24, samples: int = 32, seed: int = 3
) -> Set:
    """A piece that is turned on a gray plate before a white wall, the camera at two heights: a soft
    lamp to its left, a weaker one to its right. light: none of the sun and sky. Shapes as above.
    """
    import mitsuba as mi

    mi.set_variant(VARIANT)
    made = piece(kind, seed)
    true, scan = _shapes(kind, made, seed)
    pattern = painted(seed)
    shape = _shape(mi, true, pattern(true.vertices.astype(np.float32)), False)
    rng = np.random.default_rng(seed)
    cameras, pictures = {}, {}
    for number in range(photos):
        turn = 2 * np.pi * (number + 0.5 * (number % 2)) / photos + rng.uniform(-0.05, 0.05)
        camera = _at(scan, turn, np.radians((12.0, 36.0)[number % 2]))
        scene = mi.load_dict(_studio(mi, scan, turn) | {"piece": shape})
        radiance = _taken(mi, scene, camera, samples, number)
        name = f"IMG_{number:03d}.png"
        cameras[name], pictures[name] = camera, developed(radiance, seed * 100 + number)
    return Set(scan, as_pixels_show(pattern, scan), cameras, pictures, DAYS["cloudy"], true)


def _shapes(kind: str, made: Piece, seed: int) -> tuple[Mesh, Mesh]:
    """What is photographed, and its scan."""
    if kind == "capital":
        true = carved(made, 54_000)
        return true, true
    return carved(made, 120_000), scanned(made, 40_000, 0.0004, seed)


def _studio(mi: Any, mesh: Mesh, turn: float) -> dict[str, Any]:
    """Lamps, wall and plate of a room whose camera is at an azimuth."""
    d, foot = mesh.diagonal, float(mesh.bounds[0, 2])
    gray = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.4, 0.4, 0.38]}}
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.75, 0.74, 0.7]}}

    def panel(azimuth: float, elevation: float, far: float, half: float) -> Any:
        a, e = turn + azimuth, elevation
        toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        place = mesh.center + toward * far * d
        to = mi.ScalarTransform4f().look_at(
            origin=place.tolist(), target=mesh.center.tolist(), up=[0, 0, 1]
        )
        return to @ mi.ScalarTransform4f().scale([half * d] * 3)

    def lamp(where: Any, radiance: tuple[float, float, float]) -> dict[str, Any]:
        light = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
        return {"type": "rectangle", "to_world": where, "emitter": light}

    plate = mi.ScalarTransform4f().translate([0, 0, foot - 1e-3 * d])
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH},
        "room": {"type": "constant", "radiance": {"type": "rgb", "value": [0.2, 0.19, 0.18]}},
        "key": lamp(panel(0.8, 0.75, 1.8, 0.28), (21.0, 19.8, 17.7)),
        "fill": lamp(panel(-1.0, 0.3, 1.6, 0.4), (2.8, 3.0, 3.4)),
        "wall": {
            "type": "rectangle", "to_world": panel(np.pi, 0.0, 1.6, 2.0),
            "bsdf": {"type": "twosided", "inner": white},
        },
        "plate": {
            "type": "disk", "bsdf": gray,
            "to_world": plate @ mi.ScalarTransform4f().scale([0.75 * d] * 3),
        },
    }  # fmt: skip


def as_pixels_show(pattern: Pattern, mesh: Mesh) -> Floats:
    """(V, 3) albedo averaged over what a pixel, sampled bilinearly, shows of the surface, of the
    level of the photo whose pixels are as large as a vertex is wide.
    """
    pixel = DISTANCE * mesh.diagonal * 2 * np.tan(np.radians(FIELD_DEG) / 2) / SIZE[0]
    spacing = np.sqrt(face_areas(mesh).sum() / len(mesh.vertices))
    width = pixel * 2 ** max(0, np.round(np.log2(spacing / pixel)))
    normals = vertex_normals(mesh)
    rng = np.random.default_rng(1)
    total = np.zeros(mesh.vertices.shape)
    for _ in range(16):
        aside = rng.standard_normal(normals.shape) * 0.6 * width
        aside -= normals * np.einsum("ij,ij->i", aside, normals)[:, None]
        total += pattern((mesh.vertices + aside).astype(np.float32))
    return (total / 16).astype(np.float32)


def sky_image(light: Light) -> Floats:
    """(h, w, 3) radiance for Mitsuba's envmap, whose rows are angles from +y; z is up here, and the
    direction of each pixel says what is there.
    """
    width, height = SKY_SIZE[0] * 8, SKY_SIZE[1] * 8
    v, u = np.meshgrid(
        (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij"
    )
    theta, phi = np.pi * v, 2 * np.pi * u
    d = np.stack([np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)], -1)
    up = d[..., 2:]
    blend = np.clip(up * 3 + 0.5, 0, 1)
    cloud = 1 + 0.25 * np.sin(3 * phi + 1)[..., None] * np.clip(up, 0, 1)
    brighter = 1 + 0.6 * np.clip(up, 0, 1)
    radiance = (1 - blend) * np.array(light.ground) + blend * np.array(light.sky) * cloud * brighter
    if any(light.sun):
        disk = np.radians(1.2)
        inside = d @ light.to_sun > np.cos(disk)
        solid = np.sin(theta) * (np.pi / height) * (2 * np.pi / width)
        area = solid[inside].sum()
        radiance[inside] += np.pi * np.array(light.sun) / area
    return radiance.astype(np.float32)


def _gold(xyz: Floats) -> Floats:
    return np.tile(np.array([0.9, 0.65, 0.3], np.float32), (len(xyz), 1))


def _shape(mi: Any, mesh: Mesh, albedo: Floats, metal: bool) -> Any:
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({
        "type": "twosided",
        "inner": {
            "type": "principled",
            "base_color": {"type": "mesh_attribute", "name": "vertex_color"},
            "roughness": 0.4 if metal else 0.7, "specular": 0.5, "metallic": float(metal),
        },
    })  # fmt: skip
    shape = mi.Mesh("piece", len(mesh.vertices), len(mesh.faces), props=properties)
    shape.add_attribute("vertex_color", 3, albedo.ravel().astype(np.float32))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    return shape


def all_around(mesh: Mesh, photos: int, seed: int) -> list[Camera]:
    """Cameras on three rings around the piece."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(photos):
        azimuth = 2 * np.pi * (k + rng.uniform(-0.2, 0.2)) / photos
        out.append(_at(mesh, azimuth, np.radians((8.0, 30.0, 55.0)[k % 3])))
    return out


def _at(mesh: Mesh, azimuth: float, elevation: float) -> Camera:
    """A camera that looks at the piece's middle."""
    w, h = SIZE
    f = w / 2 / np.tan(np.radians(FIELD_DEG) / 2)
    toward = np.array([
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ])  # fmt: skip
    center = mesh.center + toward * mesh.diagonal * DISTANCE
    z = -toward
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    return Camera(Intrinsics(w, h, f, f, w / 2, h / 2), Pose(R, -R @ center))


def sensor(mi: Any, camera: Camera, samples: int) -> Any:
    """A pinhole camera. Mitsuba's looks along +z with x to the left, y up."""
    to_world = np.eye(4)
    to_world[:3, :3] = camera.pose.R.T @ np.diag([-1, -1, 1])
    to_world[:3, 3] = camera.center
    return mi.load_dict({
        "type": "perspective", "fov": FIELD_DEG, "fov_axis": "x",
        "to_world": mi.ScalarTransform4f(to_world),
        "film": {
            "type": "hdrfilm", "width": camera.width, "height": camera.height,
            "rfilter": {"type": "box"}, "pixel_format": "rgb",
        },
        "sampler": {"type": "independent", "sample_count": samples},
    })  # fmt: skip


def _taken(mi: Any, scene: Any, camera: Camera, samples: int, seed: int) -> Floats:
    """(h, w, 3) linear radiance."""
    made = mi.render(scene, sensor=sensor(mi, camera, samples), spp=samples, seed=seed)
    return np.array(made)[..., :3]


def developed(radiance: Floats, seed: int) -> np.ndarray:
    """(h, w, 3) uint8 sRGB with shot and read noise."""
    rng = np.random.default_rng(seed)
    sigma = np.sqrt(np.maximum(radiance, 0) / 15000 + 0.0015**2)
    noisy = radiance + sigma * rng.standard_normal(radiance.shape)
    return np.round(srgb_from_linear(np.clip(noisy, 0, 1)) * 255).astype(np.uint8)
