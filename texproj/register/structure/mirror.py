"""Is the photo printed the wrong way round? A mirrored photo of a symmetric object fits too.

The photo is mirrored and registered from the camera's mirror image; the better fit is right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texproj.arrays import Doubles, Mask
from texproj.camera import Camera, Intrinsics, Pose
from texproj.register.structure.solve import Candidate, approach
from texproj.register.structure.starts import placed_starts
from texproj.register.structure.view import COARSE, StructureView
from texproj.render import GBuffer
from texproj.solve.placement import placements

SCALES = (0.86, 1.0, 1.16)
STARTS = 2
LEAST_LIKENESS = 0.6
"""Correlation of the whole mirrored picture, relative to that of the picture itself, below which
there is no symmetry to speak of; symmetric facades have .68 and more."""
FLIP = np.diag([-1.0, 1.0, 1.0])


def mirrored_candidate(
    view: StructureView, camera: Camera, least_support: float
) -> Candidate | None:
    """A camera for the mirrored view of a photo near the mirror image of `camera`, with
    `least_support` or more; None if there is none, as for most objects.
    """
    images, field, valid = view.rendering(camera, COARSE)
    if not valid.any():
        return None
    own = placements(field, valid, view.fields[COARSE], (0.0,), (1.0,))[0].score
    middle = _middle_in_cam(view.camera_at(camera, COARSE), images, valid)
    facing = images.require("normal")[valid].mean(axis=0).astype(np.float64)
    start = mirrored_camera(camera, middle, facing)
    mirrored = view.mirrored
    for placed in placed_starts(mirrored, start, (0.0,), SCALES, STARTS):
        if placed.score < LEAST_LIKENESS * own:
            break
        candidate = approach(mirrored, placed.camera)
        if candidate is not None and candidate.support >= least_support:
            return candidate
    return None


def _middle_in_cam(camera: Camera, images: GBuffer, valid: Mask) -> Doubles:
    xyz = images.points(camera, *np.nonzero(valid))
    return np.median(camera.pose.apply(xyz), axis=0)


def mirrored_camera(camera: Camera, middle_in_cam: Doubles, facing_in_cam: Doubles) -> Camera:
    """The camera that sees a symmetric object as the mirrored picture of `camera` shows it.

    The plane of symmetry is taken upright in the picture, through `middle_in_cam` (3,) and along
    `facing_in_cam` (3,), the object's mean normal.
    """
    upright = np.array([0.0, 1.0, 0.0])
    across = np.cross(facing_in_cam, upright)
    length = np.linalg.norm(across)
    across = across / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    reflection = np.eye(3) - 2 * np.outer(across, across)
    turn = FLIP @ reflection
    offset = FLIP @ (middle_in_cam - reflection @ middle_in_cam)
    pose = Pose(turn @ camera.pose.R, turn @ camera.pose.t + offset)
    return Camera(mirrored_intrinsics(camera.intrinsics), pose)


def mirrored_intrinsics(k: Intrinsics) -> Intrinsics:
    """Of the same photo with left and right exchanged; p2, s1, s2 and ty change their sign."""
    sign = np.ones(14)
    sign[[5, 6] if k.is_fisheye else [3, 8, 9, 13]] = -1
    dist = tuple(np.array(k.dist) * sign[: len(k.dist)])
    return replace(k, cx=k.width - k.cx, dist=dist)
