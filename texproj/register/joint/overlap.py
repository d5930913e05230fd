"""Which photos see the same surface, and from how far apart: whom to compare with whom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.render import GBuffer, Render

SIGHT_PX = 256
"""Longer side of the depth images that decide what a photo sees."""
DEPTH_TOLERANCE = 0.02
"""A point is seen if it is at most this part of its depth behind the depth image; the images are
coarse, and a wrong guess costs a pair that matching then finds empty."""
SAMPLES_PER_PHOTO = 400
LEAST_SHARED = 0.2
"""Photos that share less than this part of what either sees are not compared (Dellepiane et al.
2013 use the same)."""
WIDEST_DEG = 50.0
"""Beyond this angle between the lines of sight patches no longer look alike."""


def sees(camera: Camera, depth: NDArray[np.float32], xyz_in_world: Doubles) -> NDArray[np.bool_]:
    """(n,) whether points are in the picture and not behind what `depth` shows."""
    h, w = depth.shape
    small = camera.resized(w, h)
    xy, z = small.project(xyz_in_world)
    inside = small.inside(xy)
    column, row = np.where(inside[:, None], xy, 0).astype(int).T
    out: NDArray[np.bool_] = inside & (z <= depth[row, column] * (1 + DEPTH_TOLERANCE))
    return out


def shared_views(cameras: Sequence[Camera], render: Render) -> tuple[Doubles, Doubles]:
    """((n, n) share of what photo i sees that photo j sees too, (n, n) mean angle in degrees
    between their lines of sight there).
    """
    small = [camera.reduced(SIGHT_PX) for camera in cameras]
    views = [render(camera) for camera in small]
    depths = [view.require("depth") for view in views]
    share, angle_deg = np.zeros((len(small),) * 2), np.full((len(small),) * 2, 180.0)
    for i, camera in enumerate(small):
        xyz = _surface_samples(camera, views[i])
        for j, other in enumerate(small):
            if i == j or not len(xyz):
                continue
            seen = sees(other, depths[j], xyz)
            share[i, j] = seen.mean()
            if seen.any():
                angle_deg[i, j] = _mean_angle_deg(xyz[seen], camera.center, other.center)
    return share, angle_deg


def choose_partners(share: Doubles, angle_deg: Doubles, count: int) -> list[tuple[int, int]]:
    """Ordered pairs (i, j): for each photo i up to `count` others, from the closest line of sight
    to the widest that still shares enough.

    Wide pairs matter: a common slide of all photos along a facade shows only where their lines
    of sight differ.
    """
    pairs = []
    for i in range(len(share)):
        usable = (np.minimum(share[i], share[:, i]) >= LEAST_SHARED) & (angle_deg[i] < WIDEST_DEG)
        usable[i] = False
        candidates = np.flatnonzero(usable)
        candidates = candidates[np.argsort(angle_deg[i, candidates])]
        spread = np.linspace(0, len(candidates) - 1, min(count, len(candidates)))
        pairs += [(i, int(j)) for j in candidates[np.unique(spread.round().astype(int))]]
    return pairs


def _surface_samples(camera: Camera, images: GBuffer) -> Doubles:
    row, column = np.nonzero(np.isfinite(images.require("depth")))
    keep = np.linspace(0, len(row) - 1, min(SAMPLES_PER_PHOTO, len(row))).astype(int)
    return images.points(camera, row[keep], column[keep])


def _mean_angle_deg(xyz: Doubles, center: Doubles, other: Doubles) -> float:
    a, b = center - xyz, other - xyz
    cosine = (a * b).sum(1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())
