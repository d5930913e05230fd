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
from scipy.spatial import cKDTree

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera, Intrinsics, Pose
from texproj.demo.object import carved, piece, scanned
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
DENSE, DRAWS = 40, 32
"""Points of the true surface for each of its vertices, and of them for each of the scan's."""

DISTANCE = 1.5
"""Of the cameras, in diagonals of the piece."""

Weather = Literal["sun", "cloudy"]
Kind = Literal["stele", "capital", "knot"]


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
    """mesh: the scan; albedo: (V, 3) float32 linear, true around its vertices, over what a pixel of
    480 by 360 may show; own: the same over what each vertex stands for, see `as_cells_show`;
    cameras and (h, w, 3) uint8 photos by name; light: the day; true: the shape that was
    photographed, and paint (V', 3) at its vertices, between which Mitsuba interpolates.
    """

    mesh: Mesh
    albedo: Floats
    own: Floats
    cameras: dict[str, Camera]
    photos: dict[str, np.ndarray]
    light: Light
    true: Mesh
    paint: Floats


def natural_set(
    kind: Kind,
    weather: Weather,
    photos: int = 12,
    samples: int = 16,
    gold: bool = False,
    seed: int = 3,
    width: int = SIZE[0],
) -> Set:
    """One set; deterministic but for the renderer's rounding. The capital has its own 54,000 faces,
    the stele is a scan of 40,000 faces of other places, 0.4 mm off, of 120,000, the knot one of
    45,000, 0.3 mm off. width: of the photos, pixels, 4 : 3.
    """
    import mitsuba as mi

    mi.set_variant(VARIANT)
    true, scan = _shapes(kind, seed)
    pattern = _gold if gold else painted(seed)
    paint = pattern(true.vertices.astype(np.float32))
    light = DAYS[weather]
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH},
        "piece": _shape(mi, true, paint, gold),
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(sky_image(light)), "scale": 1.0},
    })  # fmt: skip
    cameras, pictures = {}, {}
    for number, camera in enumerate(all_around(scan, photos, seed, (width, width * 3 // 4))):
        name = f"IMG_{number:03d}.png"
        radiance = _taken(mi, scene, camera, samples, number)
        cameras[name], pictures[name] = camera, developed(radiance, seed * 100 + number)
    truth = as_pixels_show(pattern, scan), as_cells_show(true, paint, scan)
    return Set(scan, *truth, cameras, pictures, light, true, paint)


def turntable_set(kind: Kind, photos: int = 24, samples: int = 32, seed: int = 3) -> Set:
    """A piece that is turned on a gray plate before a white wall, the camera at two heights: a soft
    lamp to its left, a weaker one to its right. light: none of the sun and sky. Shapes as above.
    """
    import mitsuba as mi

    mi.set_variant(VARIANT)
    true, scan = _shapes(kind, seed)
    pattern = painted(seed)
    paint = pattern(true.vertices.astype(np.float32))
    shape = _shape(mi, true, paint, False)
    rng = np.random.default_rng(seed)
    cameras, pictures = {}, {}
    for number in range(photos):
        turn = 2 * np.pi * (number + 0.5 * (number % 2)) / photos + rng.uniform(-0.05, 0.05)
        camera = _at(scan, turn, np.radians((12.0, 36.0)[number % 2]), SIZE)
        scene = mi.load_dict(_studio(mi, scan, turn) | {"piece": shape})
        radiance = _taken(mi, scene, camera, samples, number)
        name = f"IMG_{number:03d}.png"
        cameras[name], pictures[name] = camera, developed(radiance, seed * 100 + number)
    truth = as_pixels_show(pattern, scan), as_cells_show(true, paint, scan)
    return Set(scan, *truth, cameras, pictures, DAYS["cloudy"], true, paint)


def _shapes(kind: Kind, seed: int) -> tuple[Mesh, Mesh]:
    """What is photographed, and its scan."""
    if kind == "knot":
        return knots(seed)
    made = piece(kind, seed)
    if kind == "capital":
        true = carved(made, 54_000)
        return true, true
    return carved(made, 120_000), scanned(made, 40_000, 0.0004, seed)


def knots(seed: int) -> tuple[Mesh, Mesh]:
    """A smooth tube, knotted, and a scan of it by other points, 0.3 mm off."""
    true, scan = knot(1000, 60), knot(610, 37)
    rng = np.random.default_rng(seed)
    off = 0.0003 * rng.standard_normal((len(scan.vertices), 1))
    return true, Mesh(scan.vertices + off * vertex_normals(scan), scan.faces)


def knot(along: int, around: int) -> Mesh:
    """A (2, 3) torus knot, .5 m wide, of 2 along x around triangles, its seam smooth."""
    t = 2 * np.pi * np.arange(along) / along

    def middle(t: Doubles) -> Doubles:
        r = 2 + np.cos(3 * t)
        return 0.083 * np.column_stack([r * np.cos(2 * t), r * np.sin(2 * t), -np.sin(3 * t)])

    ahead = middle(t + 1e-4) - middle(t - 1e-4)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    out = middle(t) - 0.166 * np.column_stack([np.cos(2 * t), np.sin(2 * t), 0 * t])
    out -= ahead * np.einsum("ij,ij->i", out, ahead)[:, None]
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    side = np.cross(ahead, out)
    turn = 2 * np.pi * np.arange(around) / around
    ring = 0.036 * (
        np.cos(turn)[None, :, None] * out[:, None] + np.sin(turn)[None, :, None] * side[:, None]
    )
    xyz = (middle(t)[:, None] + ring).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    at = i * around + j
    on, up = (i + 1) % along * around + j, i * around + (j + 1) % around
    both = (i + 1) % along * around + (j + 1) % around
    faces = np.concatenate([
        np.stack([at, both, on], -1).reshape(-1, 3), np.stack([at, up, both], -1).reshape(-1, 3),
    ])  # fmt: skip
    return Mesh(xyz, faces)


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


def as_cells_show(true: Mesh, paint: Floats, scan: Mesh) -> Floats:
    """(V, 3) what was photographed, paint (V', 3) between the true shape's vertices, averaged over
    what each vertex of the scan stands for: a disk of a third of the area of its faces.
    """
    rng = np.random.default_rng(5)
    area = face_areas(true)
    face = true.faces[rng.choice(len(area), DENSE * len(true.vertices), p=area / area.sum())]
    root, along = np.sqrt(rng.random(len(face))), rng.random(len(face))
    part = np.stack([1 - root, root * (1 - along), root * along], axis=1)
    xyz, shown = (np.einsum("nk,nkc->nc", part, x[face]) for x in (true.vertices, paint))
    tree, normals = cKDTree(xyz), vertex_normals(scan)
    third = np.repeat(face_areas(scan) / 3, 3)
    radius = np.sqrt(np.bincount(scan.faces.ravel(), third, len(normals)) / np.pi)
    total = np.zeros(normals.shape)
    for _ in range(DRAWS):
        aside = rng.standard_normal(normals.shape)
        aside -= normals * np.einsum("ij,ij->i", aside, normals)[:, None]
        aside *= (radius * np.sqrt(rng.random(len(radius))) / np.linalg.norm(aside, axis=1))[
            :, None
        ]
        total += shown[tree.query(scan.vertices + aside)[1]]
    return (total / DRAWS).astype(np.float32)


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


def all_around(mesh: Mesh, photos: int, seed: int, size: tuple[int, int] = SIZE) -> list[Camera]:
    """Cameras on three rings around the piece. size: of their photos, pixels."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(photos):
        azimuth = 2 * np.pi * (k + rng.uniform(-0.2, 0.2)) / photos
        out.append(_at(mesh, azimuth, np.radians((8.0, 30.0, 55.0)[k % 3]), size))
    return out


def _at(mesh: Mesh, azimuth: float, elevation: float, size: tuple[int, int]) -> Camera:
    """A camera that looks at the piece's middle."""
    w, h = size
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
