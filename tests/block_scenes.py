"""Reliefs, photos of them and blocks of points, for placing blocks: known truth, no inverse crime.

The photos are shaded from face normals with cast shadows, paint and noise by trimesh's rays; the
points carry the noise of triangulation along and across the line of sight, and outliers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from texproj.camera import Camera, Intrinsics, Pose
from texproj.mesh import Mesh
from texproj.photo import Photo, PhotoInfo
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.similarity import Similarity

SIZE = (384, 256)
FULL = 4
EYES = ((1.5, -2, -11), (-4, -1, -10.5), (5, 1, -10), (-1, 3, -12), (4, -3, -12), (-6, 2, -11))


def relief(seed: int) -> Mesh:
    """A wall 12 x 8, its front at z = 0, with boxes standing out toward -z, finely meshed."""
    rng = np.random.default_rng(seed)
    boxes = [trimesh.creation.box(bounds=[(-6, -4, 0), (6, 4, 1)])]
    for _ in range(40):
        x, y = rng.uniform(-6, 5), rng.uniform(-4, 3.2)
        w, h, out = rng.uniform(0.3, 2.0), rng.uniform(0.3, 2.0), rng.uniform(0.2, 1.6)
        boxes.append(trimesh.creation.box(bounds=[(x, y, -out), (x + w, y + h, 0.1)]))
    solid = trimesh.util.concatenate(boxes)
    return Mesh(*trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, 0.5))


def twin(seed: int) -> Mesh:
    """A relief that is the same after half a turn about the line of sight."""
    half = relief(seed)
    keep = (half.vertices[half.faces][:, :, 0] > -1e-9).all(axis=1)
    right = half.faces[keep]
    turned = half.vertices * (-1, -1, 1)
    return Mesh(
        np.concatenate([half.vertices, turned]), np.concatenate([right, right + len(turned)])
    )


def random_similarity(rng: np.random.Generator) -> Similarity:
    """Any rotation, sizes from a seventh to seven times, far from the origin."""
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    return Similarity(float(np.exp(rng.uniform(-2, 2))), turn, rng.normal(0, 20, 3))


def mirrored(mesh: Mesh) -> Mesh:
    """The mesh with left and right exchanged, outsides still outside."""
    return Mesh(mesh.vertices * (-1, 1, 1), mesh.faces[:, ::-1])


def moved(mesh: Mesh, by: Similarity) -> Mesh:
    return Mesh(by.apply(mesh.vertices), mesh.faces)


def in_a_room(mesh: Mesh) -> Mesh:
    """The mesh on a floor of 50 x 50, with a wall behind and two aside."""
    corner, span = np.array([-25.0, 4, -25]), np.array([50.0, -24, 30])
    x, y, z = np.diag(span)
    sides = [(corner, x, z), (corner + z, x, y), (corner, z, y), (corner + x, y, z)]
    parts = [trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)]
    for start, a, b in sides:
        square = trimesh.creation.box(bounds=[(0, 0, 0), (1, 1, 1)])
        flat = trimesh.Trimesh(
            start + square.vertices[:, :1] * a + square.vertices[:, 1:2] * b,
            square.faces[np.abs(square.face_normals[:, 2]) > 0.5][:2],
            process=False,
        )
        parts.append(flat.subdivide().subdivide().subdivide())
    whole = trimesh.util.concatenate(parts)
    return Mesh(whole.vertices, whole.faces)


def with_background(block: Reconstruction, frame: Similarity, count: int = 3000) -> Reconstruction:
    """The block with points of a landscape far behind that every photo shows; frame: block from
    world.
    """
    rng = np.random.default_rng(0)
    far = rng.uniform((-40, -40, 6), (40, 40, 40), (count, 3))
    photos = len(block.names)
    more = photos * np.arange(1, count + 1)
    xy = np.stack([camera.project(frame.apply(far))[0] for camera in block.cameras], axis=1)
    return Reconstruction(
        block.names,
        block.cameras,
        block.lenses,
        np.concatenate([block.points, frame.apply(far)]),
        np.append(block.error_px, np.full(count, 0.7)),
        np.append(block.angle_rad, np.full(count, 0.1)),
        np.append(block.track_starts, block.track_starts[-1] + more),
        np.append(block.observer, np.tile(np.arange(photos), count)),
        np.concatenate([block.xy_px, xy.reshape(-1, 2).astype(np.float32)]),
    )


@dataclass(frozen=True, eq=False)
class Wall:
    """A relief of which six photos are taken; twofold: it looks the same upside down."""

    seed: int
    twofold: bool = False

    @cached_property
    def mesh(self) -> Mesh:
        return twin(self.seed) if self.twofold else relief(self.seed)

    @cached_property
    def solid(self) -> trimesh.Trimesh:
        return trimesh.Trimesh(self.mesh.vertices, self.mesh.faces, process=False)

    @cached_property
    def cameras(self) -> dict[str, Camera]:
        """Full size, of the wall's own frame, some turned aside."""
        k = Intrinsics(FULL * SIZE[0], FULL * SIZE[1], 1500, 1500, 760, 520)
        rng = np.random.default_rng(self.seed)
        return {
            f"{i}.jpg": Camera(k, Pose.look_at(eye, rng.uniform(-1, 1, 3), up=(0, -1, 0)))
            for i, eye in enumerate(EYES)
        }

    def photo(self, name: str) -> Photo:
        """Reduced, sunlit with shadows."""
        camera = self.cameras[name].scaled(1 / FULL)
        y, x = np.mgrid[: camera.height, : camera.width] + 0.5
        origins, rays = camera.rays(np.stack([x.ravel(), y.ravel()], axis=1))
        hit, ray, face = self.solid.ray.intersects_location(origins, rays, multiple_hits=False)
        normal, sun = self.solid.face_normals[face], np.array([0.4, -0.5, -0.77])
        shadow = self.solid.ray.intersects_any(hit + 1e-3 * normal, np.tile(sun, (len(hit), 1)))
        light = 0.25 + np.clip(normal @ sun, 0, 1) * ~shadow
        paint = 0.4 + 0.1 * np.sin(7 * hit[:, 0] + 3 * hit[:, 1]) * np.sin(5 * hit[:, 1])
        image = np.full(camera.height * camera.width, 0.7)
        image[ray] = paint * light
        rng = np.random.default_rng(int(name[0]))
        encoded = 255 * image ** (1 / 2.2) + rng.normal(0, 3, image.shape)
        gray = np.clip(encoded, 0, 255).astype(np.uint8).reshape(camera.height, camera.width)
        info = PhotoInfo(name, FULL * SIZE[0], FULL * SIZE[1])
        return Photo(info, np.dstack([gray] * 3))

    @cached_property
    def photos(self) -> dict[str, Photo]:
        return {name: self.photo(name) for name in self.cameras}


def block_of(
    solid: trimesh.Trimesh,
    cameras: dict[str, Camera],
    frame: Similarity,
    count: int = 1800,
    seed: int = 0,
) -> Reconstruction:
    """What structure from motion would make of photos of a solid, in a frame of its own.

    frame: block from world. Points lie where photos have texture, which is in clusters; each is
    off by a pixel or so, more along the line of sight than across, and one in ten by a lot.
    """
    rng = np.random.default_rng(seed)
    views = list(cameras.values())
    true, viewers = _seen_points(solid, views, count, rng)
    rays = np.array([c.center for c in views])[[v[0] for v in viewers]] - true
    distance = np.linalg.norm(rays, axis=1, keepdims=True)
    across = 1.0 * distance / views[0].intrinsics.fx
    xyz = true + rng.standard_normal(true.shape) * across
    xyz += rays / distance * rng.standard_normal(distance.shape) * 3 * across
    wild = rng.random(len(xyz)) < 0.1
    xyz[wild] += 0.3 * rays[wild] * rng.standard_normal((int(wild.sum()), 1))
    starts = np.concatenate([[0], np.cumsum([len(v) for v in viewers])])
    observer = np.concatenate(viewers)
    shown = np.repeat(np.where(wild[:, None], xyz, true), np.diff(starts), axis=0)
    xy = np.full((len(observer), 2), np.nan)
    for k, camera in enumerate(views):
        xy[observer == k] = camera.project(shown[observer == k])[0]
    return Reconstruction(
        names=tuple(cameras),
        cameras=tuple(frame.camera(camera) for camera in views),
        lenses=("lens",) * len(views),
        points=frame.apply(xyz),
        error_px=np.full(len(xyz), 0.7),
        angle_rad=np.full(len(xyz), np.radians(20.0)),
        track_starts=starts,
        observer=observer,
        xy_px=(xy + rng.normal(0, 0.7, xy.shape)).astype(np.float32),
    )


def _seen_points(
    solid: trimesh.Trimesh, cameras: list[Camera], count: int, rng: np.random.Generator
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Points of the surface that two cameras or more see, and which do."""
    clusters = rng.random((60, 2))
    each = count // len(cameras)
    found, viewers = [], []
    for camera in cameras:
        spread = clusters[rng.integers(0, 60, 2 * each)] + rng.normal(0, 0.04, (2 * each, 2))
        origins, rays = camera.rays(spread * (camera.width, camera.height))
        hit = solid.ray.intersects_location(origins, rays, multiple_hits=False)[0]
        seen = np.stack([_sees(solid, other, hit) for other in cameras], axis=1)
        few = np.flatnonzero(seen.sum(axis=1) >= 2)[:each]
        found.append(hit[few])
        viewers += [np.flatnonzero(row) for row in seen[few]]
    return np.concatenate(found), viewers


def _sees(solid: trimesh.Trimesh, camera: Camera, xyz: np.ndarray) -> np.ndarray:
    to_eye = camera.center - xyz
    start = xyz + 1e-4 * to_eye
    return camera.inside(camera.project(xyz)[0]) & ~solid.ray.intersects_any(start, to_eye)


def error_percent(found: Camera, true: Camera, points: np.ndarray, normals: np.ndarray) -> float:
    """Mean distance between two cameras' images of the points that face the true one inside its
    picture, percent of the width.
    """
    xy, depth = true.project(points)
    toward = ((true.center - points) * normals).sum(axis=1) > 0
    seen = true.inside(xy) & (depth > 0) & toward
    gap = np.linalg.norm(found.project(points[seen])[0] - xy[seen], axis=1)
    return float(100 * np.nan_to_num(gap, nan=1e6).mean() / true.width)
