"""Photos with rough cameras of a thing whose edges are paint: brought to agree with each other on
the surface, from small pictures to larger ones, and believed as far as they do.

A smooth mesh has no edges to be found in a photo, so no photo can be registered alone. But all
together can: where their cameras are right, they show the same at the same points of the surface,
which only one place of a curved surface lets them do. Method: ours, by the joint refinement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Bools, Doubles
from texproj.camera import Camera
from texproj.options import RefineOptions
from texproj.register.joint.lenses import PhotoStart
from texproj.register.joint.refine import refine
from texproj.register.joint.refined import Refined
from texproj.register.joint.session import LoadPhoto, anchor_points
from texproj.register.proof.camps import Ruling
from texproj.register.proof.judge import LooksHere, judge
from texproj.render import Render

SIZES_PX = (192, 384)
"""Working sizes, each used at once and at twice: a patch is sought up to 4 % of the width away at
first, 26 pixels of 640."""
PARTNERS = 4
"""With how many others a photo is compared at most."""
FIRST_PERCENT = 3.0
"""How far a rough camera is taken to be off at first, percent of the longer side."""
LEAST_PERCENT = 0.1
LEAST_PHOTOS = 3
"""Two photos agree on a surface in many places."""


@dataclass(frozen=True, eq=False)
class Together:
    """cameras: as given where nothing could be said; expected_error_px: (n,) full size, NaN there;
    start_error_px: how far the rough cameras were off, root mean square; rulings: what the other
    photos say of each.
    """

    cameras: tuple[Camera, ...]
    expected_error_px: Doubles
    start_error_px: float
    rulings: dict[int, Ruling]


def brought_together(
    photos: Sequence[PhotoStart], load_photo: LoadPhoto, render: Render, options: RefineOptions
) -> Together:
    """Cameras that agree on the surface, from rough ones; those that are fixed are right already.
    What is said of the others' errors beforehand does not count. The rest as for `refine`.
    """
    cameras = [photo.camera for photo in photos]
    points = anchor_points(cameras, render)
    side = np.array([max(camera.width, camera.height) for camera in cameras])
    free = np.array([not photo.fixed for photo in photos])
    now, error, percent = tuple(cameras), np.full(len(cameras), np.nan), FIRST_PERCENT
    for size in SIZES_PX:
        coarse = replace(options, working_px=size, partners=min(PARTNERS, options.partners))
        starts = [
            replace(photo, camera=now[k], sigma_px=percent / 100 * side[k])
            for k, photo in enumerate(photos)
        ]
        found = refine(starts, load_photo, render, coarse)
        now, error = found.cameras, _errors(found)
        percent = _typical_percent(_motion_px(cameras, now, points), side, free)
    told = judge(now, LooksHere(now, load_photo, render), np.flatnonzero(free).tolist())
    return Together(now, error, percent / 100 * float(side.mean()), told)


def _errors(found: Refined) -> Doubles:
    error = found.expected_error_px.copy()
    error[list(found.thrown_out)] = np.nan
    return error


def _motion_px(before: Sequence[Camera], after: Sequence[Camera], points: list[Doubles]) -> Doubles:
    """(n,) mean motion of the surface in each photo, full-size pixels."""
    return np.array(
        [
            np.nanmean(np.linalg.norm(b.project(xyz)[0] - a.project(xyz)[0], axis=1))
            if len(xyz) else np.nan
            for a, b, xyz in zip(before, after, points, strict=True)
        ]
    )  # fmt: skip


def _typical_percent(shift_px: Doubles, side: Doubles, free: Bools) -> float:
    """Root mean square of the motion, percent of the longer side."""
    percent = 100 * shift_px[free] / side[free]
    percent = percent[np.isfinite(percent)]
    if not len(percent):
        return FIRST_PERCENT
    return max(float(np.sqrt((percent**2).mean())), LEAST_PERCENT)
