"""Similarities: the seven numbers that put a block of photos, in its own frame, onto a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from texproj.arrays import Doubles
from texproj.camera import Camera, Pose


@dataclass(frozen=True, eq=False)
class Similarity:
    """A transform `world_from_block`: ``x_in_world = scale R x_in_block + t``.

    scale: mesh units per block unit, positive; R: (3, 3) rotation; t: (3,) in mesh units.
    """

    scale: float
    R: Doubles
    t: Doubles

    @classmethod
    def identity(cls) -> Similarity:
        return cls(1.0, np.eye(3), np.zeros(3))

    @property
    def inverse(self) -> Similarity:
        return Similarity(1 / self.scale, self.R.T, -self.R.T @ self.t / self.scale)

    def __matmul__(self, other: Similarity) -> Similarity:
        """``c_from_b @ b_from_a`` is ``c_from_a``."""
        scale = self.scale * other.scale
        return Similarity(scale, self.R @ other.R, self.apply(other.t[None])[0])

    def apply(self, xyz: ArrayLike) -> Doubles:
        """(n, 3) points from the right-hand frame to the left-hand one."""
        return self.scale * np.asarray(xyz, np.float64) @ self.R.T + self.t

    def camera(self, in_block: Camera) -> Camera:
        """A camera of the block, whose poses are `cam_from_block`, as a camera of the world."""
        R = in_block.pose.R @ self.R.T
        return Camera(in_block.intrinsics, Pose(R, self.scale * in_block.pose.t - R @ self.t))

    def step(self, delta: ArrayLike, pivot: Doubles, unit: float) -> Similarity:
        """The similarity followed by a small one about `pivot` (3,), world.

        delta: (7,) rotation vector (rad), shift in `unit`s of the world, logarithm of the scale.
        """
        delta = np.asarray(delta, np.float64)
        scale = float(np.exp(np.clip(delta[6], -1, 1)))
        turn = cv2.Rodrigues(delta[:3].reshape(3, 1))[0]
        t = scale * turn @ (self.t - pivot) + pivot + unit * delta[3:6]
        return Similarity(self.scale * scale, turn @ self.R, t)
