"""Cameras of photos as stored, for photos made upright: many programs ignore EXIF's orientation."""

from __future__ import annotations

import numpy as np

from texproj.camera import Camera, Intrinsics, Pose

QUARTER_TURNS = {1: 0, 6: 1, 3: 2, 8: 3}
"""Clockwise quarter turns that make a photo of an EXIF orientation upright; the others mirror."""


def upright(camera: Camera, orientation: int) -> Camera | None:
    """The camera of the photo after EXIF's orientation is applied, from that of the stored pixels.

    None for mirrored photos (no camera makes them) and for tilted sensors.
    """
    turns = QUARTER_TURNS.get(orientation)
    tilted = any(camera.intrinsics.dist[12:])
    if turns is None or tilted:
        return None
    for _ in range(turns):
        camera = _turned_clockwise(camera)
    return camera


def _turned_clockwise(camera: Camera) -> Camera:
    """A quarter turn: pixel (x, y) goes to (height - y, x), the axes with it."""
    k, pose = camera.intrinsics, camera.pose
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    dist = list(k.dist)
    if k.is_fisheye:
        if len(dist) == 8:
            p1, p2, s1, s2 = dist[4:]
            dist[4:] = [p2, -p1, -s2, s1]
    elif len(dist) >= 4:  # decentering is a vector (p2, p1) in the image
        dist[2], dist[3] = dist[3], -dist[2]
    if not k.is_fisheye and len(dist) >= 12:  # so are the thin prism terms (s1, s3) and (s2, s4)
        s1, s2, s3, s4 = dist[8:12]
        dist[8:12] = [-s3, -s4, s1, s2]
    turned = Intrinsics(k.height, k.width, k.fy, k.fx, k.height - k.cy, k.cx, tuple(dist), k.model)
    return Camera(turned, Pose(turn @ pose.R, turn @ pose.t))
