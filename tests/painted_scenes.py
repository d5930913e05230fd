"""Smooth things whose edges are paint, for asking what proves a camera: known truth, no inverse
crime.

The demo's photographer casts rays at a fine surface through a lens with distortion, under sun and
sky, with the noise of a sensor; the scan has other vertices, few faces and noise of its own. Paint
is drawn on a board that is wrapped around the thing: nothing of it is in the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import PchipInterpolator

from texproj.camera import Camera
from texproj.demo.jpeg import Exif, jpeg
from texproj.demo.light import Lighting
from texproj.demo.noise import noise
from texproj.demo.photographer import Scene, ShotOptions, photograph, set_up
from texproj.demo.picks import picked
from texproj.demo.sensor import Sensor
from texproj.demo.views import COMPACT, View, camera_at
from texproj.files import write_atomically
from texproj.formats.cameras import cameras_json
from texproj.formats.correspondences import correspondences_csv
from texproj.formats.models.ply import write_ply
from texproj.mesh import Mesh, vertex_normals
from texproj.photo import Correspondences, Photo, PhotoInfo
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.register.block.similarity import Similarity

BOARD_PX = 2048
PROFILE = ((0.0, 0.0), (0.13, 0.0), (0.16, 0.03), (0.25, 0.2), (0.3, 0.42), (0.27, 0.62),
           (0.17, 0.78), (0.13, 0.88), (0.15, 0.97), (0.18, 1.0), (0.15, 0.99), (0.11, 0.88),
           (0.0, 0.84))  # fmt: skip
"""Radius and height of the vase, metres, from the middle of its foot over the lip into its neck."""
HAZE = Lighting(sun=(0.6, 0.54, 0.46), sun_disk_deg=4.0, sky=(0.44, 0.48, 0.54))
SCAN_NOISE = 4e-4
"""Metres along the normals, two thirds of its variance smooth over centimetres."""


def board(seed: int, figures: int = 1600) -> np.ndarray:
    """(BOARD_PX, BOARD_PX, 3) float32 linear paint: figures of all sizes, nothing twice."""
    rng = np.random.default_rng(seed)
    image = np.full((BOARD_PX, BOARD_PX, 3), (0.55, 0.5, 0.42), np.float32)
    for k in range(figures):
        largest = 150 if k < 250 else 30
        size = int(np.exp(rng.uniform(np.log(6), np.log(largest))) * (1.6 if k < 30 else 1))
        x, y = rng.integers(0, BOARD_PX, 2)
        color = tuple(float(c) for c in rng.uniform(0.03, 0.75, 3))
        kind = rng.integers(3)
        for aside in (-BOARD_PX, 0, BOARD_PX):  # what goes on behind the seam
            at = (int(x) + aside, int(y))
            if kind == 0:
                axes = (size, int(size * rng.uniform(0.3, 1)))
                cv2.ellipse(image, at, axes, float(rng.uniform(0, 180)), 0, 360, color, -1)
            elif kind == 1:
                corners = at + rng.normal(0, size, (int(rng.integers(3, 7)), 2))
                cv2.fillPoly(image, [corners.astype(np.int32)], color)
            else:
                line = at + np.cumsum(rng.normal(0, size, (6, 2)), axis=0)
                width = max(2, size // 6)
                cv2.polylines(image, [line.astype(np.int32)], False, color, width)
    grain = cv2.GaussianBlur(rng.standard_normal(image.shape[:2], np.float32), (0, 0), 4)
    image *= 1 + 0.075 * grain[..., None] / grain.std()
    return cv2.GaussianBlur(np.clip(image, 0.02, 0.9), (0, 0), 1.2)


def wrapped(seed: int, across: Callable[[np.ndarray], np.ndarray]) -> Callable:
    """Paint by position. across: (n, 3) points to (n, 2) positions on the board, 0..1."""
    paint = board(seed)

    def color(xyz):
        column, row = (across(xyz) * (BOARD_PX - 1)).astype(np.float32).T
        parts = range(0, max(len(column), 1), 30_000)
        out = [
            cv2.remap(paint, column[k : k + 30_000, None], row[k : k + 30_000, None],
                      cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
            for k in parts if len(column)
        ]  # fmt: skip
        return np.concatenate(out).reshape(-1, 3) if out else np.zeros((0, 3), np.float32)

    return color


def around(xyz: np.ndarray) -> np.ndarray:
    """The board wrapped around the z axis."""
    turn = np.arctan2(xyz[:, 1], xyz[:, 0]) / (2 * np.pi) + 0.5
    return np.stack([turn, np.clip(xyz[:, 2], 0, 1)], axis=1)


def above(xyz: np.ndarray) -> np.ndarray:
    """The board laid on a cushion."""
    return xyz[:, [0, 2]] * (0.9, 0.9) + (0.5, 0.14)


def vase(rings: int, sectors: int, phase: float = 0.0) -> Mesh:
    """A surface of revolution about z, smooth but for its tessellation."""
    knots = np.array(PROFILE)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    curve = PchipInterpolator(length, knots)(np.linspace(0, length[-1], rings))
    angle = phase + np.arange(sectors) * 2 * np.pi / sectors
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    xyz = np.concatenate(
        [np.concatenate([ring * max(r, 1e-4), np.full((sectors, 1), z)], axis=1) for r, z in curve]
    )
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(sectors), indexing="ij")
    a, b = (i * sectors + j).ravel(), (i * sectors + (j + 1) % sectors).ravel()
    quads = np.stack([a, b, a + sectors, b + sectors], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 3]], quads[:, [0, 3, 2]]])
    return Mesh(xyz, faces.astype(np.int32))


def cushion(cells: int, phase: float = 0.0) -> Mesh:
    """A bulging sheet about 1 x .8 in x and z, its front towards -y, with soft dents."""
    u, w = np.meshgrid(np.linspace(-1, 1, cells), np.linspace(-1, 1, cells), indexing="ij")
    u, w = u + phase / cells * (1 - u**2), w + phase / cells * (1 - w**2)
    bulge = np.sqrt(np.maximum((1 - u**4) * (1 - w**4), 0))
    dents = 0.03 * np.sin(2.1 * u + 1) * np.cos(2.7 * w - 0.4) + 0.02 * np.sin(3.3 * u * w + 2)
    xyz = np.stack([0.5 * u, -0.16 * bulge - dents * bulge, 0.4 * w + 0.4], axis=-1)
    i, j = np.meshgrid(np.arange(cells - 1), np.arange(cells - 1), indexing="ij")
    a = (i * cells + j).ravel()
    faces = np.concatenate(
        [np.stack([a, a + cells, a + cells + 1], 1), np.stack([a, a + cells + 1, a + 1], 1)]
    )
    return Mesh(xyz.reshape(-1, 3), faces.astype(np.int32))


def noisy(mesh: Mesh, seed: int) -> Mesh:
    """As a scanner gives it."""
    rng = np.random.default_rng([seed, 5])
    broad = noise(mesh.vertices.astype(np.float32), 0.5, seed + 5, 1.5)
    height = SCAN_NOISE * (
        np.sqrt(2 / 3) * broad + np.sqrt(1 / 3) * rng.standard_normal(len(broad))
    )
    return Mesh(mesh.vertices + vertex_normals(mesh) * height[:, None], mesh.faces)


@dataclass(frozen=True, eq=False)
class Painted:
    """A painted thing, the scan of it and photos. true: its fine surface; scan: of it; across: how
    the paint lies on it; views: from where; light: on it; axis: of revolution, if it has one.
    """

    name: str
    true: Mesh
    scan: Mesh
    across: Callable
    views: tuple[View, ...]
    seed: int = 0
    long_side: int = 640
    background: str = "garden"

    @cached_property
    def scene(self) -> Scene:
        return set_up(self.true, wrapped(self.seed, self.across), HAZE, gloss=0.15, sky_rays=16)

    @cached_property
    def cameras(self) -> dict[str, Camera]:
        return {
            f"IMG_{i + 1:04d}.jpg": camera_at(
                view, self.scan.bounds, self.long_side, np.random.default_rng([self.seed, i, 51])
            )
            for i, view in enumerate(self.views)
        }

    @cached_property
    def pictures(self) -> dict[str, np.ndarray]:
        """(h, w, 3) uint8 of each photo."""
        return {
            name: photograph(self.scene, camera, self._how(i)).pixels
            for i, (name, camera) in enumerate(self.cameras.items())
        }

    def _how(self, number: int) -> ShotOptions:
        sensor = Sensor(ev=self.views[number].ev)
        return ShotOptions(background=self.background, sensor=sensor, seed=self.seed + number)

    def photo(self, name: str) -> Photo:
        pixels = self.pictures[name]
        return Photo(PhotoInfo(name, pixels.shape[1], pixels.shape[0]), pixels)

    def picks(self, name: str, sigma_px: float = 0.7, count: int = 12) -> Correspondences:
        """As somebody careful clicks them, with the help of more than the mesh shows."""
        rng = np.random.default_rng([self.seed, 3])
        return picked(self.scan, self.cameras[name], count, sigma_px, rng)

    def off_percent(self, name: str, found: Camera) -> float:
        """Mean distance of the surface that a photo shows from its true place, percent of the
        longer side.
        """
        true = self.cameras[name]
        normals = vertex_normals(self.scan)
        xy, depth = true.project(self.scan.vertices)
        toward = ((true.center - self.scan.vertices) * normals).sum(axis=1) > 0
        seen = np.flatnonzero(true.inside(xy) & (depth > 0) & toward)
        seen = seen[:: max(1, len(seen) // 2000)]
        gap = np.linalg.norm(found.project(self.scan.vertices[seen])[0] - xy[seen], axis=1)
        return float(100 * np.nan_to_num(gap, nan=1e6).mean() / max(true.width, true.height))

    def written(
        self, root: Path, mesh: Mesh | None = None, starts: Sequence[CameraRecord] = (),
        picks: dict[str, Correspondences] | None = None,
    ) -> Project:  # fmt: skip
        """A project of the photos and a mesh, the scan by default."""
        scan = mesh or self.scan
        (root / "mesh").mkdir(parents=True)
        (root / "photos").mkdir()
        write_ply(root / "mesh" / "scan.ply", scan.vertices, scan.faces, None)
        for number, (name, pixels) in enumerate(self.pictures.items()):
            exif = Exif(self.views[number].body, 0.0, number, turned=False)
            write_atomically(root / "photos" / name, jpeg(pixels, exif))
        for name, points in (picks or {}).items():
            path = root / "correspondences" / f"{Path(name).stem}.csv"
            write_atomically(path, correspondences_csv(points))
        if starts:
            write_atomically(root / "cameras.json", cameras_json(list(starts)))
        return Project.open(root)


def prior(name: str, camera: Camera) -> CameraRecord:
    """A camera that somebody gives to start from."""
    return CameraRecord(name, camera.width, camera.height, camera.intrinsics, camera.pose, "prior")


def turned(picks: Correspondences, angle_deg: float) -> Correspondences:
    """The picks with their points turned about z."""
    a = np.radians(angle_deg)
    R = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    return replace(picks, xyz_in_world=picks.xyz_in_world @ R.T)


def turn_about_z(angle_deg: float) -> Similarity:
    a = np.radians(angle_deg)
    R = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    return Similarity(1.0, R, np.zeros(3))


def vase_scene(
    photos: int = 9, span_deg: float = 150.0, seed: int = 0, long_side: int = 640, fine: int = 420
) -> Painted:
    """A vase from one side to the other, at three heights. fine: faces around its true surface."""
    azimuths = np.linspace(-span_deg / 2, span_deg / 2, photos)
    views = tuple(
        View(float(a), (8.0, 20.0, 32.0)[k % 3], 1.12, (0.2, -0.2, 0.0)[k % 3], body=COMPACT)
        for k, a in enumerate(azimuths)
    )
    scan = noisy(vase(97, 120, 0.013), seed)
    return Painted("vase", vase(300 * fine // 420, fine), scan, around, views, seed, long_side)


def cushion_scene(photos: int = 8, seed: int = 0, long_side: int = 640, fine: int = 420) -> Painted:
    """A patterned cushion from its front. fine: vertices along the sides of its true surface."""
    azimuths = np.linspace(-38, 38, photos)
    views = tuple(
        View(float(a), (5.0, 22.0, 38.0)[k % 3], 1.1, upright=False, body=COMPACT)
        for k, a in enumerate(azimuths)
    )
    scan = noisy(cushion(130, 0.31), seed)
    return Painted("cushion", cushion(fine), scan, above, views, seed, long_side)
