"""A whole synthetic project: scan, photos, what a user would know, and the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.demo.jpeg import Exif, focal_px_of_exif, jpeg
from texproj.demo.light import Lighting, unit
from texproj.demo.object import carved, piece, scanned
from texproj.demo.pattern import painted
from texproj.demo.photographer import Scene, ShotOptions, photograph, set_up, shaded
from texproj.demo.picks import picked
from texproj.demo.sensor import Sensor
from texproj.demo.views import View, arc, camera_at, disturbed, tour
from texproj.mesh import Mesh, vertex_normals
from texproj.options import DemoOptions
from texproj.photo import Correspondences
from texproj.records import CameraRecord

FOOTPRINT_SAMPLES = 12
"""Points over which a footprint is averaged."""


@dataclass(frozen=True, eq=False)
class DemoPhoto:
    """file: name; encoded: the JPEG with its EXIF; object_mask: (h, w) uint8, 255 = the piece;
    truth: the camera it was taken with; start: a rough one, or None; picks: or none.
    """

    file: str
    encoded: bytes
    object_mask: NDArray[np.uint8]
    truth: Camera
    start: Camera | None = None
    picks: Correspondences | None = None


@dataclass(frozen=True, eq=False)
class DemoProject:
    """mesh: the scan, world; photos; albedo, shaded: (V, 3) float32 linear, the true paint at the
    scan's vertices and the light they send out at EV 0, without highlights.
    """

    mesh: Mesh
    photos: tuple[DemoPhoto, ...]
    albedo: Floats
    shaded: Floats

    @property
    def truth(self) -> list[CameraRecord]:
        """The true cameras, as records of cameras.json."""
        return [
            CameraRecord(p.file, p.truth.width, p.truth.height, p.truth.intrinsics,
                         p.truth.pose, "registered", "import")
            for p in self.photos
        ]  # fmt: skip

    @property
    def starts(self) -> list[CameraRecord]:
        """What is known in advance: rough cameras of some photos."""
        return [
            CameraRecord(p.file, p.start.width, p.start.height, p.start.intrinsics,
                         p.start.pose, "prior", "import")
            for p in self.photos if p.start is not None
        ]  # fmt: skip


def make_demo(
    options: DemoOptions, progress: Callable[[str], None] = lambda _: None
) -> DemoProject:
    """Carve, paint, scan and photograph a piece. Deterministic for the options.

    progress: called with a word on each step.
    """
    progress("carving the stone")
    made = piece(options.object, options.seed)
    origin = np.array(options.origin)
    true = carved(made, options.carved_faces)
    scan = scanned(made, options.faces, options.scan_noise_mm / 1000, options.seed)
    scan = Mesh(scan.vertices + origin, scan.faces)
    true = Mesh(true.vertices + origin, true.faces)
    pattern = painted(options.seed, options.paint)
    scene = set_up(true, pattern, Lighting(), gloss=options.gloss, origin=origin)
    photos = []
    views = (tour if options.starts else arc)(options.photos)
    for number, view in enumerate(views):
        progress(f"taking photo {number + 1} of {options.photos}")
        photos.append(_taken(scene, scan, view, number, options))
    albedo, light = true_colors(scene, scan)
    return DemoProject(scan, tuple(photos), albedo, light)


def true_colors(scene: Scene, scan: Mesh, footprint: float = 0.0) -> tuple[Floats, Floats]:
    """((V, 3) albedo, (V, 3) light sent out) of the true surface at each scan vertex.

    footprint: 0 for the very point; else the deviation, in metres, of the Gaussian over which
    the surface around it is averaged, as a pixel averages (a square pixel does so with 0.29 of
    its width, bilinear sampling adds about as much).
    """
    xyz = (scan.vertices - scene.origin).astype(np.float32)
    return colors_on(scene, xyz, vertex_normals(scan).astype(np.float32), footprint)


def colors_on(
    scene: Scene, xyz: Floats, normals: Floats, footprint: float = 0.0
) -> tuple[Floats, Floats]:
    """The same at any (n, 3) points of the local frame near the surface, with (n, 3) normals."""
    rng = np.random.default_rng([len(xyz), 29])
    parts = []
    for _ in range(FOOTPRINT_SAMPLES if footprint else 1):
        aside = rng.standard_normal(xyz.shape, np.float32) * np.float32(footprint)
        aside -= normals * np.einsum("ij,ij->i", aside, normals)[:, None]
        parts.append(_colors_near(scene, xyz + aside, normals))
    albedo, light = np.mean(parts, axis=0)
    return albedo, light


def _colors_near(scene: Scene, xyz: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Albedo and light sent out where lines along (n, 3) normals, begun 3 mm above the points,
    meet the surface; where they do not, the points themselves stand in.
    """
    sky = np.tile(np.asarray(scene.lighting.sky, np.float32), (len(xyz), 1))
    above = xyz + np.float32(0.003) * normals
    hits = scene.caster.first_hits(above, -normals)
    near = np.flatnonzero(hits.found)
    xyz, normals = xyz.copy(), normals.copy()
    xyz[near] = above[near] - normals[near] * hits.distance[:, None]
    here = scene.caster.at(hits, scene.surface)
    normals[near], sky[near] = unit(here[:, :3]), here[:, 3:]
    return scene.pattern(xyz), shaded(scene, xyz, normals, sky)


def _taken(scene: Scene, scan: Mesh, view: View, number: int, options: DemoOptions) -> DemoPhoto:
    rng = np.random.default_rng([options.seed, number, 41])
    camera = camera_at(view, scan.bounds, options.long_side, rng)
    tint = 1 + rng.normal(0, 0.025, 3) * (1, 0, 1)
    sensor = Sensor(ev=view.ev, balance=(float(tint[0]), 1.0, float(tint[2])))
    how = ShotOptions(sensor=sensor, visitor=view.visitor, seed=options.seed * 1000 + number)
    shot = photograph(scene, camera, how)
    exif = Exif(view.body, view.ev, number, turned=view.upright)
    photo = DemoPhoto(
        f"IMG_{number + 1:04d}.jpg", jpeg(shot.pixels, exif), shot.object_mask, camera
    )
    if not options.starts:
        return photo
    if number % 2:
        count = int(rng.integers(10, 15))
        return replace(photo, picks=picked(scan, camera, count, options.pick_sigma_px, rng))
    return replace(photo, start=_guessed(camera, view, scan, options, rng))


def _guessed(
    camera: Camera, view: View, scan: Mesh, options: DemoOptions, rng: np.random.Generator
) -> Camera:
    """A rough camera: a disturbed pose; the lens as calibrated, or only EXIF's focal length."""
    rough = disturbed(camera, scan.vertices[::37], options.start_error_px, rng)
    if options.calibrated:
        return rough
    f = focal_px_of_exif(view.body, camera.width, camera.height)
    ideal = replace(
        rough.intrinsics, fx=f, fy=f, cx=camera.width / 2, cy=camera.height / 2, dist=(0.0,) * 5
    )
    return replace(rough, intrinsics=ideal)
