"""Cameras around a rough one that are worth trying: found by placing a small rendering."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from texproj.arrays import Doubles, Mask
from texproj.camera import Camera, Pose
from texproj.register.motion import motion_px
from texproj.register.structure.view import COARSE, StructureView
from texproj.render import GBuffer
from texproj.solve.placement import Placement, pivot_px, placements

LEAST_PIXELS = 200
"""Mesh pixels at the coarse level below which there is nothing to place."""
DISTINCT = 0.02
"""Image motion, as a share of the width, by which two starts must differ."""
YAWS_DEG, PITCHES_DEG = (-20.0, -10.0, 10.0, 20.0), (-10.0, 10.0)
DISTANCES = (0.6, 1.6)
"""Orbits about what the prior sees, and distances relative to its own, tried in a wider search."""
PROBES = 60
"""Surface points by which image motion is measured."""


@dataclass(frozen=True, eq=False)
class Start:
    """A camera (full size) worth trying and the correlation of its view with the photo."""

    camera: Camera
    score: float


def placed_starts(
    view: StructureView,
    prior: Camera,
    rolls_rad: Sequence[float],
    scales: Sequence[float],
    count: int,
) -> list[Start]:
    """Up to `count` cameras, the likeliest first, whose view of the mesh is the prior's one
    turned, enlarged and shifted so that it fits the photo; empty where the mesh is not in view.

    A shift becomes a rotation of the camera, an enlargement a step along its line of sight.
    """
    images, field, valid = view.rendering(prior, COARSE)
    if valid.sum() < LEAST_PIXELS:
        return []
    camera = view.camera_at(prior, COARSE)
    pivot, depth = pivot_px(valid), float(np.median(images.require("depth")[valid]))
    probes = _probes(camera, images, valid)
    found: list[Start] = []
    for placement in placements(field, valid, view.fields[COARSE], rolls_rad, scales):
        start = replace(prior, pose=placed_pose(camera, placement, pivot, depth))
        if all(motion_px(start, s.camera, probes) > DISTINCT * prior.width for s in found):
            found.append(Start(start, placement.score))
        if len(found) == count:
            break
    return found


def cameras_around(view: StructureView, prior: Camera) -> list[Camera]:
    """Cameras that look at the same place from elsewhere: for a prior wrong in position."""
    images, _, valid = view.rendering(prior, COARSE)
    if not valid.any():
        return []
    ray = ray_in_cam(view.camera_at(prior, COARSE), pivot_px(valid))
    middle = ray * float(np.median(images.require("depth")[valid]))
    turns = np.radians([(0, y, 0) for y in YAWS_DEG] + [(p, 0, 0) for p in PITCHES_DEG])
    orbits = [_orbited(prior, middle, turn, 1.0) for turn in turns]
    return [*orbits, *(_orbited(prior, middle, np.zeros(3), d) for d in DISTANCES)]


def _orbited(camera: Camera, middle_in_cam: Doubles, turn: Doubles, distance: float) -> Camera:
    R = cv2.Rodrigues(turn.reshape(3, 1))[0]
    t = R @ (camera.pose.t - middle_in_cam) + middle_in_cam * distance
    return replace(camera, pose=Pose(R @ camera.pose.R, t))


def placed_pose(camera: Camera, placement: Placement, pivot: Doubles, depth: float) -> Pose:
    """The pose whose view is that of `camera` with `placement` applied about `pivot` (2,) px,
    exactly so for a surface at `depth` that is small in the picture.
    """
    axis = ray_in_cam(camera, pivot)
    aim = ray_in_cam(camera, pivot + np.array(placement.shift_px))
    roll = axis / np.linalg.norm(axis) * placement.roll_rad
    turn = _turn_between(axis, aim) @ cv2.Rodrigues(roll.reshape(3, 1))[0]
    nearer = camera.pose.t + axis * (depth / placement.scale - depth)
    return Pose(turn @ camera.pose.R, turn @ nearer)


def ray_in_cam(camera: Camera, xy_px: Doubles) -> Doubles:
    """(3,) direction with z = 1, camera axes, that the pixel sees."""
    k = camera.intrinsics
    ideal = k.undistort((np.asarray(xy_px, float).reshape(1, 2) - (k.cx, k.cy)) / (k.fx, k.fy))[0]
    return np.array([ideal[0], ideal[1], 1.0])


def _probes(camera: Camera, images: GBuffer, valid: Mask) -> Doubles:
    y, x = np.nonzero(valid)
    pick = np.linspace(0, len(x) - 1, min(PROBES, len(x))).astype(int)
    return images.points(camera, y[pick], x[pick])


def _turn_between(a: Doubles, b: Doubles) -> Doubles:
    """(3, 3) the smallest rotation that takes direction a to direction b."""
    axis = np.cross(a, b)
    sine, cosine = np.linalg.norm(axis), a @ b
    if sine < 1e-12:
        return np.eye(3)
    return cv2.Rodrigues((axis / sine * np.arctan2(sine, cosine)).reshape(3, 1))[0]
