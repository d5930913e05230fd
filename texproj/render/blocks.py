"""The shaders' uniform blocks (std140, matrices by column) as bytes."""

from __future__ import annotations

import numpy as np

from texproj.camera import Array, Camera, Intrinsics
from texproj.render.lens import ideal_radius
from texproj.render.surface import Surface
from texproj.render.target import Tile


def camera_block(surface: Surface, camera: Camera, tile: Tile, z: tuple[float, float]) -> bytes:
    """`include/camera.glsl` for one tile of a camera's picture; z: near and far depth."""
    cam_from_local = np.eye(4)
    cam_from_local[:3] = surface.cam_from_local(camera)
    columns = [cam_from_local.T, clip_from_cam(camera.intrinsics, tile, *z).T]
    return np.stack(columns).astype(np.float32).tobytes()


def clip_from_cam(k: Intrinsics, tile: Tile, near: float, far: float) -> Array:
    """(4, 4) projection by the pinhole part of `k` onto a tile; clip w is the depth."""
    w, h = tile.width, tile.height
    return np.array(
        [
            [2 * k.fx / w, 0, 2 * (k.cx - tile.left) / w - 1, 0],
            [0, 2 * k.fy / h, 2 * (k.cy - tile.top) / h - 1, 0],
            [0, 0, (far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, 1, 0],
        ]
    )


def lens_block(k: Intrinsics) -> bytes:
    """`include/lens.glsl` for a photo's distortion."""
    dist = _fourteen(k)
    tilt = np.eye(4)
    tilt[:3, :3] = _tilt(dist[12], dist[13])
    limit = 0.999 * k.max_radius
    if not k.is_fisheye:
        limit = min(1.05 * ideal_radius(k), limit)
    values = [*dist[:12], *tilt.T.ravel(), limit, float(k.is_fisheye), 0, 0]
    return np.array(values, np.float32).tobytes()


def _fourteen(k: Intrinsics) -> tuple[float, ...]:
    """The coefficients as the shader names them: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 and tilt."""
    if not k.is_fisheye:
        return (*k.dist, *(0.0,) * 14)[:14]
    k1, k2, k3, k4, p1, p2, s1, s3 = (*k.dist, *(0.0,) * 4)[:8]
    return (k1, k2, p1, p2, k3, k4, 0.0, 0.0, s1, 0.0, s3, 0.0, 0.0, 0.0)


def _tilt(x: float, y: float) -> Array:
    """(3, 3) homography of a sensor tilted by x, y (rad), as OpenCV defines it."""
    cx, sx, cy, sy = np.cos(x), np.sin(x), np.cos(y), np.sin(y)
    R = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ [[1, 0, 0], [0, cx, sx], [0, -sx, cx]]
    onto_plane = np.array([[R[2, 2], 0, -R[0, 2]], [0, R[2, 2], -R[1, 2]], [0, 0, 1]])
    return onto_plane @ R
