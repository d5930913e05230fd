"""A small project for the tests of the web page: a box of known shape before four cameras."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import trimesh
import uvicorn

from texproj.camera import Camera, Intrinsics, Pose
from texproj.formats.cameras import cameras_json
from texproj.options import PreviewOptions
from texproj.preview.server import Server, guarded_app, listen
from texproj.preview.session import Session
from texproj.records import CameraRecord

WIDTH, HEIGHT = 640, 480
DISTORTION = (-0.12, 0.05, 0.002, -0.0015, 0.0)
BROKEN = "9999.jpg"
SHUTDOWN_S = 15
"""At most, until connections are closed; a busy machine takes longer than the one that serves."""


def blocks() -> trimesh.Trimesh:
    """A plate with blocks of different heights: corners everywhere, fine enough for lenses."""
    rng = np.random.default_rng(3)
    parts = [trimesh.creation.box((4, 3, 0.2))]
    for x in np.linspace(-1.6, 1.6, 6):
        for y in np.linspace(-1.1, 1.1, 5):
            size = (*rng.uniform(0.2, 0.5, 2), rng.uniform(0.2, 0.9))
            parts.append(trimesh.creation.box(size, trimesh.transformations.translation_matrix(
                (x, y, size[2] / 2 + 0.1))))  # fmt: skip
    mesh = trimesh.util.concatenate(parts)
    return mesh.subdivide_to_size(0.12)


def cameras() -> list[Camera]:
    """Four views; principal point well off center, strong distortion."""
    found = []
    for k in range(4):
        angle = 0.5 * (k - 1.5)
        center = (5 * np.sin(angle), -2.2, 5 * np.cos(angle))
        k_ = Intrinsics(WIDTH, HEIGHT, 610.0, 606.0, 350.0 + 4 * k, 215.0, DISTORTION)
        found.append(Camera(k_, Pose.look_at(center, (0.1, 0.05 * k, 0.2), (0, 1, 0))))
    return found


def surface_paint(xyz: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(n,) gray 0..255 of a world point: a pattern fixed to the world, shaded by direction."""
    wave = np.sin(9 * xyz[:, 0]) * np.sin(8 * xyz[:, 1] + 2) * np.cos(7 * xyz[:, 2])
    return 120 + 60 * wave + 50 * (normal @ np.array([0.35, -0.25, 0.25]))


def photograph(mesh: trimesh.Trimesh, camera: Camera) -> np.ndarray:
    """(h, w) uint8 by rays through the full lens model, 2 x 2 per pixel; its own ray caster
    (trimesh), not the page's and not the renderer's."""
    sub = (np.arange(2) + 0.5) / 2
    caster = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh)
    total = np.zeros((HEIGHT, WIDTH))
    for dx in sub:
        for dy in sub:
            x, y = np.meshgrid(np.arange(WIDTH) + dx, np.arange(HEIGHT) + dy)
            total += _one_ray_each(caster, camera, np.stack([x.ravel(), y.ravel()], 1))
    return np.clip(np.round(total / len(sub) ** 2), 0, 255).astype(np.uint8)


def _one_ray_each(
    caster: trimesh.ray.ray_pyembree.RayMeshIntersector, camera: Camera, xy: np.ndarray
) -> np.ndarray:
    k, pose = camera.intrinsics, camera.pose
    enough = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)
    ideal = cv2.undistortPoints(xy[:, None], k.K, np.array(k.dist), criteria=enough)[:, 0]
    directions = np.concatenate([ideal, np.ones((len(xy), 1))], 1) @ pose.R
    origins = np.broadcast_to(pose.center, directions.shape)
    face, ray, point = caster.intersects_id(origins, directions, False, return_locations=True)
    gray = np.full(len(xy), 35.0)
    gray[ray] = surface_paint(point, caster.mesh.face_normals[face])
    return gray.reshape(HEIGHT, WIDTH)


@lru_cache
def photographs() -> list[np.ndarray]:
    """One photo for each camera."""
    mesh = blocks()
    return [photograph(mesh, camera) for camera in cameras()]


def make_project(root: Path, registered: int = 3) -> list[Camera]:
    """The project in `root`; the last cameras stay unknown; one more photo is not a photo."""
    mesh, views = blocks(), cameras()
    for folder in ("mesh", "photos", "correspondences"):
        (root / folder).mkdir(parents=True)
    mesh.export(root / "mesh" / "blocks.ply")
    for k, photo in enumerate(photographs()):
        cv2.imwrite(str(root / "photos" / f"{k:04d}.png"), photo)
    (root / "photos" / BROKEN).write_bytes(b"this is not a photo")
    records = [
        CameraRecord(f"{k:04d}.png", WIDTH, HEIGHT, c.intrinsics, c.pose, "registered", "import",
                     {"expected_error_px": 0.4 + 2 * k})
        for k, c in enumerate(views[:registered])
    ]  # fmt: skip
    records += [
        CameraRecord(f"{k:04d}.png", WIDTH, HEIGHT, c.intrinsics, None, "prior")
        for k, c in enumerate(views)
        if k >= registered
    ]
    (root / "cameras.json").write_text(cameras_json(records, {}))
    return views


def corner_points(camera: Camera, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """`count` visible surface points, spread over the picture: (n, 2) pixels, (n, 3) world."""
    mesh = blocks()
    rng = np.random.default_rng(seed)
    xy = np.stack(np.meshgrid(np.linspace(150, 500, 5), np.linspace(110, 370, 4)), -1).reshape(
        -1, 2
    )
    origins, directions = camera.rays(xy)
    caster = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh)
    _, ray, xyz = caster.intersects_id(origins, directions, False, return_locations=True)
    chosen = rng.permutation(len(ray))[:count]
    return xy[ray[chosen]], xyz[chosen]


@contextmanager
def running(
    root: Path, token: str | None = None, port: int = 0, **options: object
) -> Iterator[str]:
    """The server in a thread of this process; yields its address."""
    session = Session(root, PreviewOptions(**{"light_faces": 1000, **options}))
    listener = listen("127.0.0.1", port)
    port = listener.getsockname()[1]
    config = uvicorn.Config(
        guarded_app(session, port, token),
        log_level="warning",
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    server = Server(config, session)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.02)
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join(2 * SHUTDOWN_S)
        listener.close()
