"""As many photos of a real scene as one likes: its mesh seen from new places, with the colors that
its photos show there.

The rays are trimesh's (embree), at half the size; what a pixel shows is looked up in the photos of
the scene that see the same place from nearest by, so its texture is that of photographs. Lens,
exposure, noise and the sky behind are made up. For time and memory; and do all hang together?
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation, Slerp

from texproj.camera import Camera, Intrinsics, Pose
from texproj.formats.cameras import read_cameras
from texproj.formats.meshes import read_mesh
from texproj.formats.photos import read_photo, read_photo_info

SOURCES = 3
"""Photos from which a new one takes its colors."""
ASPECT = 1.5
DISTORTION = (-0.06, 0.02, 0.0, 0.0, 0.0)
HIDDEN = 0.01
"""A surface is hidden in a photo where it lies so much of the distance behind what is seen."""
WALK, TURN_DEG, ROLL_DEG = 0.06, 4.0, 3.0
"""How far a photographer strays from the line between two places, distances to the scene; how far
aside he aims; how crooked he holds the camera."""


@dataclass(frozen=True, eq=False)
class Source:
    """A photo of the scene: its camera, picture (float32) and depth at a quarter of its size."""

    camera: Camera
    pixels: np.ndarray
    depth: np.ndarray


@dataclass(frozen=True, eq=False)
class Place:
    """A scene to be photographed: its solid, its photos in the order in which somebody walked."""

    solid: trimesh.Trimesh
    sources: tuple[Source, ...]

    @classmethod
    def of(cls, folder: Path) -> Place:
        solid = trimesh.Trimesh(*read_mesh(folder / "mesh.ply"), process=False)
        records = read_cameras(folder / "cameras_reference.json").records
        return cls(solid, tuple(_source(folder, r.file, r.camera, solid) for r in records))

    def cameras(self, count: int, longest: int, seed: int) -> tuple[Camera, ...]:
        """New places between the old ones, near each other, aimed and held by hand."""
        rng = np.random.default_rng(seed)
        old = [source.camera for source in self.sources]
        at = np.linspace(0, len(old) - 1, count)
        turns = Slerp(range(len(old)), Rotation.from_matrix([c.pose.R for c in old]))(at)
        centers = np.array([[np.interp(t, range(len(old)), axis) for axis in
                             np.array([c.center for c in old]).T] for t in at])  # fmt: skip
        far = float(np.median([np.nanmedian(s.depth) for s in self.sources]))
        height = round(longest / ASPECT)
        focal = old[0].intrinsics.fx / old[0].width * longest
        lens = Intrinsics(longest, height, focal, focal, 0.495 * longest, 0.51 * height, DISTORTION)
        made = []
        for center, turn in zip(centers, turns, strict=True):
            aside = np.radians([*rng.uniform(-TURN_DEG, TURN_DEG, 2), rng.normal(0, ROLL_DEG)])
            R = Rotation.from_rotvec(aside).as_matrix() @ turn.as_matrix()
            strayed = center + far * WALK * rng.uniform(-1, 1, 3)
            made.append(Camera(lens, Pose(R, -R @ strayed)))
        return tuple(made)

    def photograph(self, camera: Camera, seed: int) -> np.ndarray:
        """(h, w, 3) uint8 BGR."""
        rng = np.random.default_rng([seed, 17])
        whole = cv2.resize(_surface(camera.scaled(0.5), self.solid), (camera.width, camera.height))
        seen = np.isfinite(whole[..., 0])
        xyz = whole[seen]
        distance = [np.linalg.norm(s.camera.center - camera.center) for s in self.sources]
        nearest = np.argsort(distance)[:SOURCES]
        total, weight = np.zeros((len(xyz), 3), np.float32), np.zeros(len(xyz), np.float32)
        for k in nearest:
            color, sees = _looked_up(self.sources[k], xyz)
            share = sees * np.float32(1 / (distance[k] / distance[nearest[-1]] + 0.02) ** 2)
            total += color * share[:, None]
            weight += share
        picture = np.full((camera.height, camera.width, 3), (190, 170, 150), np.float32)
        picture[seen] = np.where(weight[:, None] > 0, total / np.maximum(weight, 1e-9)[:, None], 60)
        picture *= np.float32(2 ** rng.uniform(-0.3, 0.3))
        picture += rng.standard_normal(picture.shape, np.float32) * 2.5
        return picture.clip(0, 255).astype(np.uint8)

    def written(
        self, folder: Path, count: int, longest: int, seed: int = 0
    ) -> Iterator[tuple[str, Camera]]:
        """Take `count` photos into a folder; each with its true camera when it is there. Those
        that are there already are not taken again."""
        folder.mkdir(parents=True, exist_ok=True)
        for k, camera in enumerate(self.cameras(count, longest, seed)):
            file = folder / f"DSC_{k:04d}.jpg"
            if not file.is_file():
                part = file.with_suffix(".part.jpg")
                cv2.imwrite(str(part), self.photograph(camera, k), [cv2.IMWRITE_JPEG_QUALITY, 93])
                part.rename(file)
            yield file.name, camera


def _source(folder: Path, name: str, camera: Camera, solid: trimesh.Trimesh) -> Source:
    path = folder / "photos" / name
    pixels = read_photo(path, read_photo_info(path)).pixels[..., ::-1].astype(np.float32)
    small = camera.scaled(0.25)
    depth = small.pose.apply(_surface(small, solid).reshape(-1, 3))[:, 2].astype(np.float32)
    return Source(camera, pixels, depth.reshape(small.height, small.width))


def _surface(camera: Camera, solid: trimesh.Trimesh) -> np.ndarray:
    """(h, w, 3) float32 what each pixel sees of the solid, world; NaN where there is none."""
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    xyz = np.full((camera.height * camera.width, 3), np.nan, np.float32)
    origins, rays = camera.rays(np.stack([x.ravel(), y.ravel()], axis=1))
    for start in range(0, len(rays), 1 << 18):
        part = slice(start, start + (1 << 18))
        hit, ray, _ = solid.ray.intersects_location(origins[part], rays[part], multiple_hits=False)
        xyz[start + ray] = hit
    return xyz.reshape(camera.height, camera.width, 3)


def _looked_up(source: Source, xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) colors of points in a photo, and (n,) whether it sees them."""
    xy, depth = source.camera.project(xyz)
    xy = np.nan_to_num(xy, nan=-1e4).astype(np.float32)
    ratio = source.depth.shape[1] / source.camera.width
    near = _remapped(source.depth, xy * np.float32(ratio))
    with np.errstate(invalid="ignore"):
        sees = (depth > 0) & (np.abs(near / depth - 1) < HIDDEN) & source.camera.inside(xy)
    return _remapped(source.pixels, xy), sees


def _remapped(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Bilinear, pixel centers at halves; by rows of 32,000, which is what OpenCV takes."""
    parts = [
        cv2.remap(image, part[:, None, 0] - 0.5, part[:, None, 1] - 0.5, cv2.INTER_LINEAR)
        for part in np.array_split(xy, -(-len(xy) // 30_000))
    ]
    return np.concatenate(parts)[:, 0]
