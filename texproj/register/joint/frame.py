"""How sure refined cameras are: how well they agree, and where they lie together on the mesh.

The ties of photos with each other say much about the first and little about the second: a common
similarity of all cameras shows only by the relief of the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from texproj.arrays import Bools, Doubles
from texproj.camera import Camera, Pose
from texproj.solve.reprojection import projection_jacobian
from texproj.solve.shared_lens import LensParameters

Cameras = Sequence[Camera]

STEP = 1e-6
"""Of the numeric derivative of a similarity, as a part of the camera's distance."""
SIMILARITY_STEPS = 3
"""Gauss-Newton steps; motions of a few pixels are nearly linear."""


@dataclass(frozen=True, eq=False)
class Similarity:
    """A common motion of cameras against the mesh: x -> exp(log_scale) R(rotation) (x - center) +
    center + shift, in world coordinates. rotation: (3,) rad, a rotation vector; shift: (3,) mesh
    units; center: (3,) world.
    """

    log_scale: float
    rotation: Doubles
    shift: Doubles
    center: Doubles

    @classmethod
    def of(cls, seven: Doubles, center: Doubles) -> Similarity:
        """From log scale, rotation and shift one after the other."""
        return cls(float(seven[0]), seven[1:4], seven[4:7], center)

    def moved(self, pose: Pose) -> Pose:
        """The pose of a camera that moves along: it sees x where `pose` sees the moved x."""
        scale, turn = np.exp(self.log_scale), cv2.Rodrigues(self.rotation)[0]
        t = pose.R @ (self.center + self.shift - scale * turn @ self.center) + pose.t
        return Pose(pose.R @ turn, t / scale)


@dataclass(frozen=True, eq=False)
class Certainty:
    """agreement_px: (n,) expected error of each photo against the others, full-size pixels of the
    surface, once one common similarity is taken out; frame: (7, 7) covariance of that similarity,
    as `Similarity.of` takes it, about `center`.
    """

    agreement_px: Doubles
    frame: Doubles
    center: Doubles


def certainty(
    cameras: Cameras, points: Sequence[Doubles], lenses: LensParameters, solved: Bools,
    covariance: Doubles,
) -> Certainty:  # fmt: skip
    """points: of each photo (n, 3) world points in its view, none of photos that do not take part;
    solved: (n,) whether a camera could move; covariance: (p, p) of the joint problem's step,
    infinite where it says nothing.
    """
    center = np.concatenate(points).mean(axis=0)
    if not np.isfinite(covariance).all():
        return Certainty(np.full(len(points), np.inf), np.full((7, 7), np.inf), center)
    by_step = _by_step(cameras, points, lenses, solved)
    by_frame = _by_frame(cameras, points, center)
    to_frame = np.linalg.pinv(by_frame) @ by_step
    apart = by_step - by_frame @ to_frame
    frame = to_frame @ covariance @ to_frame.T
    return Certainty(_spread_px(apart, covariance, points), frame, center)


def frame_px(
    cameras: Cameras, points: Sequence[Doubles], center: Doubles, frame: Doubles
) -> Doubles:
    """(n,) what a common similarity of this (7, 7) covariance moves in each photo, full-size
    pixels; infinite where that says nothing.
    """
    if not np.isfinite(frame).all():
        return np.full(len(points), np.inf)
    return _spread_px(_by_frame(cameras, points, center), frame, points)


def _spread_px(rows: Doubles, covariance: Doubles, points: Sequence[Doubles]) -> Doubles:
    """(n,) root mean square over each photo's points; rows: (2 m, p) derivative of their pixels."""
    count = np.array([len(p) for p in points])
    owner = np.repeat(np.arange(len(count)), 2 * count)
    variance = np.maximum(np.einsum("ip,ip->i", rows @ covariance, rows), 0)
    return np.sqrt(np.bincount(owner, variance, len(count)) / np.maximum(count, 1))


def common_similarity(
    before: Cameras, after: Cameras, points: Sequence[Doubles], center: Doubles
) -> Similarity:
    """The similarity about `center` by which the cameras have moved together: least squares over
    what they see.
    """
    seven = np.zeros(7)
    for _ in range(SIMILARITY_STEPS):
        rows, target = [], []
        for old, new, xyz in zip(before, after, points, strict=True):
            now = Camera(old.intrinsics, Similarity.of(seven, center).moved(old.pose))
            rows.append(by_similarity(now, xyz, center))
            target.append((new.project(xyz)[0] - now.project(xyz)[0]).ravel())
        matrix, aim = np.concatenate(rows), np.concatenate(target)
        known = np.isfinite(aim)
        seven = seven + np.linalg.lstsq(matrix[known], aim[known], rcond=None)[0]
    return Similarity.of(seven, center)


def _by_step(
    cameras: Cameras, points: Sequence[Doubles], lenses: LensParameters, solved: Bools
) -> Doubles:
    """(2 m, p) derivative of the pixels of all points by the joint problem's step."""
    columns, width = lenses.columns, 6 * len(cameras) + lenses.count
    out = np.zeros((2 * sum(map(len, points)), width))
    for k, (camera, xyz, rows) in enumerate(zip(cameras, points, _rows(points), strict=True)):
        own = projection_jacobian(camera, xyz, lenses.names).reshape(-1, 6 + len(lenses.names))
        out[rows, 6 * k : 6 * k + 6] = own[:, :6] * solved[k]
        out[rows, 6 * len(cameras) + columns[k]] = own[:, 6:] * lenses.free[columns[k]]
    return out


def _by_frame(cameras: Cameras, points: Sequence[Doubles], center: Doubles) -> Doubles:
    """(2 m, 7) derivative of the pixels of all points by a common similarity."""
    out = np.zeros((2 * sum(map(len, points)), 7))
    for camera, xyz, rows in zip(cameras, points, _rows(points), strict=True):
        out[rows] = by_similarity(camera, xyz, center)
    return out


def _rows(points: Sequence[Doubles]) -> list[slice]:
    end = np.cumsum([2 * len(p) for p in points])
    return [slice(e - 2 * len(p), e) for e, p in zip(end, points, strict=True)]


def by_similarity(camera: Camera, xyz: Doubles, center: Doubles) -> Doubles:
    """(2 n, 7) derivative of the pixels of (n, 3) world points by a similarity of the camera."""
    return projection_jacobian(camera, xyz).reshape(-1, 6) @ _pose_change(camera.pose, center)


def _pose_change(pose: Pose, center: Doubles) -> Doubles:
    """(6, 7) step of a pose by a similarity about `center`, by differences."""
    size = float(np.linalg.norm(pose.center - center))
    out = np.zeros((6, 7))
    for column, h in enumerate((STEP,) * 4 + (STEP * size,) * 3):
        seven = np.zeros(7)
        seven[column] = h
        there = Similarity.of(seven, center).moved(pose)
        change = there.R @ pose.R.T
        turn = np.array([change[2, 1], change[0, 2], change[1, 0]])  # OpenCV rounds small ones to 0
        out[:3, column] = turn / h
        out[3:, column] = (there.t - cv2.Rodrigues(turn)[0] @ pose.t) / h
    return out
