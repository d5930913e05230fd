"""How sure refined cameras are: how well they agree, and where they lie together on the mesh.

The ties of photos with each other say much about the first and little about the second: a common
similarity of all cameras shows only by the relief of the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np

from texproj.arrays import Bools, Doubles, Index
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


class Covariance(Protocol):
    """That of the joint problem's step: six numbers a camera, then those of the lenses."""

    def times(self, columns: Doubles) -> Doubles:
        """(p, k) it times (p, k)."""

    def of_camera(self, k: int, lens: Index) -> Doubles:
        """(6 + m, 6 + m) of camera k's numbers and those numbered `lens` (m,) of its lens."""


def certainty(
    cameras: Cameras, points: Sequence[Doubles], lenses: LensParameters, solved: Bools,
    covariance: Covariance | None,
) -> Certainty:  # fmt: skip
    """points: of each photo (n, 3) world points in its view, none of photos that do not take part;
    solved: (n,) whether a camera could move; covariance: None where it says nothing.
    """
    center = np.concatenate(points).mean(axis=0)
    if covariance is None:
        return Certainty(np.full(len(points), np.inf), np.full((7, 7), np.inf), center)
    steps = [
        _Step.of(k, camera, xyz, lenses, solved) for k, (camera, xyz) in enumerate(
            zip(cameras, points, strict=True))
    ]  # fmt: skip
    frames = [by_similarity(c, xyz, center) for c, xyz in zip(cameras, points, strict=True)]
    to_frame = _to_frame(steps, frames, 6 * len(cameras) + lenses.count)
    with_frame = covariance.times(to_frame.T)
    frame = to_frame @ with_frame
    spread = [
        step.spread_apart(f, covariance.of_camera(k, lenses.columns[k]), with_frame, frame)
        for k, (step, f) in enumerate(zip(steps, frames, strict=True))
    ]
    return Certainty(np.array(spread), frame, center)


@dataclass(frozen=True, eq=False)
class _Step:
    """How the joint problem's step moves what one camera sees. columns: (q,) of the step that move
    it; rows: (2 m, q) derivative of its pixels by these.
    """

    columns: Index
    rows: Doubles

    @classmethod
    def of(
        cls, k: int, camera: Camera, xyz: Doubles, lenses: LensParameters, solved: Bools
    ) -> _Step:
        """Of camera k, which sees (m, 3) world points."""
        own, lens = 6 * k + np.arange(6), lenses.columns[k]
        rows = projection_jacobian(camera, xyz, lenses.names).reshape(-1, 6 + len(lenses.names))
        free = np.concatenate([np.full(6, solved[k]), lenses.free[lens]])
        return cls(np.concatenate([own, 6 * len(solved) + lens]), rows * free)

    def spread_apart(
        self, frame_rows: Doubles, own: Doubles, with_frame: Doubles, frame: Doubles
    ) -> float:
        """Root mean square of the pixels, the common similarity taken out. frame_rows: (2 m, 7)
        their derivative by that; own: (q, q) covariance of the step; with_frame: (p, 7) that of
        the similarity with it; frame: (7, 7).
        """
        variance = np.einsum("ip,pq,iq->i", self.rows, own, self.rows)
        variance -= 2 * np.einsum("ip,pf,if->i", self.rows, with_frame[self.columns], frame_rows)
        variance += np.einsum("if,fg,ig->i", frame_rows, frame, frame_rows)
        return _root_mean(variance)


def _to_frame(steps: Sequence[_Step], frames: Sequence[Doubles], width: int) -> Doubles:
    """(7, p) the similarity that comes nearest to what a step does, least squares."""
    inverse = np.linalg.pinv(np.concatenate(frames))
    out, first = np.zeros((7, width)), 0
    for step in steps:
        out[:, step.columns] += inverse[:, first : first + len(step.rows)] @ step.rows
        first += len(step.rows)
    return out


def frame_px(
    cameras: Cameras, points: Sequence[Doubles], center: Doubles, frame: Doubles
) -> Doubles:
    """(n,) what a common similarity of this (7, 7) covariance moves in each photo, full-size
    pixels; infinite where that says nothing.
    """
    if not np.isfinite(frame).all():
        return np.full(len(points), np.inf)
    spread = []
    for camera, xyz in zip(cameras, points, strict=True):
        rows = by_similarity(camera, xyz, center)
        spread.append(_root_mean(np.einsum("if,fg,ig->i", rows, frame, rows)))
    return np.array(spread)


def _root_mean(variance: Doubles) -> float:
    """px, of the (2 m,) variances of m points' two coordinates; 0 of none."""
    return float(np.sqrt(2 * np.maximum(variance, 0).mean())) if len(variance) else 0.0


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
