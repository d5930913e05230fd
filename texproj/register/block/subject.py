"""What a block or a scan is about, where it shows more: a vase in a room, a relief on a wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Bools, Doubles, Floats
from texproj.camera import Camera

LEAST_TURN = 0.05
"""Smallest eigenvalue of the axes' normal equations, per photo: below it they are parallel."""
PLANES, PLANES_TRIED = 8, 200
"""A room has six planes or more; so many samples of the surface are taken for one in turn."""
LEAST_PLANE = 0.06
"""Share of the surface that makes a plane a floor or a wall."""
THICKNESS, LEAST_COSINE = 0.02, 0.95
"""What belongs to a plane: distance, sizes of the mesh, and cosine between normals."""


@dataclass(frozen=True, eq=False)
class Aim:
    """middle: (3,) the point that optical axes pass closest; distance: the photos' median one."""

    middle: Doubles
    distance: float


def aim_of(cameras: Sequence[Camera]) -> Aim | None:
    """What cameras look at together; None if their axes are parallel or it lies behind one."""
    axes = np.array([camera.pose.R[2] for camera in cameras])
    centers = np.array([camera.center for camera in cameras])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    normal = across.sum(axis=0)
    if np.linalg.eigvalsh(normal)[0] < LEAST_TURN * len(cameras):
        return None
    middle = np.linalg.solve(normal, np.einsum("nij,nj->i", across, centers))
    depth = np.einsum("ij,ij->i", middle - centers, axes)
    return Aim(middle, float(np.median(depth))) if (depth > 0).all() else None


def in_relief(xyz: Floats, normal: Floats, seed: int) -> Bools:
    """(n,) which samples (n, 3) of a surface of size 1 belong to none of its large planes."""
    rng = np.random.default_rng(seed)
    left = np.ones(len(xyz), bool)
    for _ in range(PLANES):
        rest = np.flatnonzero(left)
        few = rng.choice(rest, min(PLANES_TRIED, len(rest)), replace=False)
        probe = rng.choice(len(xyz), min(2000, len(xyz)), replace=False)
        counts = [_on_plane(xyz[probe], normal[probe], xyz[k], normal[k]).mean() for k in few]
        if not len(few) or max(counts) < LEAST_PLANE:
            break
        best = few[int(np.argmax(counts))]
        left &= ~_on_plane(xyz, normal, xyz[best], normal[best])
    return left


def _on_plane(xyz: Floats, normal: Floats, point: Floats, direction: Floats) -> Bools:
    flat = np.abs((xyz - point) @ direction) < THICKNESS
    return flat & (np.abs(normal @ direction) > LEAST_COSINE)
