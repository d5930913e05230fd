"""A white wall in photos of known pose: its light, averaged over small squares of pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.appearance.flash.lamp import corner_part
from texproj.arrays import Bools, Doubles, Floats, Index
from texproj.camera import Camera

ACROSS = 40
"""Squares along the longer side of a photo: averages of 12 pixels of 480."""

DARK, CLIPPED = 0.02, 0.9
"""Linear light between which a square is used: noise below, cut above."""

SMOOTH = 0.05
"""Relative spread within a square above which it shows more than wall."""


@dataclass(frozen=True, eq=False)
class WallPatches:
    """n squares of wall. log_light: (n,) of the mean; photo: (n,) number; xyz: (n, 3) on the wall,
    z = 0, in the camera's axes; normal: (n, 3) of the wall, the same axes; rho: (n,) squared
    distance from the picture's middle over that of its corner; photos: how many there are.
    """

    log_light: Doubles
    photo: Index
    xyz: Doubles
    normal: Doubles
    rho: Doubles
    photos: int

    def of(self, photos: Sequence[int]) -> WallPatches:
        """Those of some photos, numbered anew."""
        new = np.full(self.photos, -1)
        new[list(photos)] = np.arange(len(photos))
        rows = new[self.photo] >= 0
        return WallPatches(
            self.log_light[rows], new[self.photo[rows]], self.xyz[rows], self.normal[rows],
            self.rho[rows], len(photos),
        )  # fmt: skip

    def every(self, step: int) -> WallPatches:
        """One of `step` squares."""
        rows = slice(None, None, step)
        return WallPatches(
            self.log_light[rows], self.photo[rows], self.xyz[rows], self.normal[rows],
            self.rho[rows], self.photos,
        )  # fmt: skip


def wall_patches(
    cameras: Sequence[Camera], lights: Sequence[Floats], walls: Sequence[NDArray[np.bool_]]
) -> WallPatches:
    """cameras: in the frame of the wall, which is z = 0; lights: (h, w, 3) linear photos, of the
    cameras' sizes; walls: (h, w) where they show nothing but wall.
    """
    parts = [_patches(*one) for one in zip(cameras, lights, walls, strict=True)]
    numbers = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    together = [np.concatenate([part[k] for part in parts]) for k in range(4)]
    light, xyz, normal, rho = together
    return WallPatches(light, numbers, xyz, normal, rho, len(parts))


def _patches(camera: Camera, light: Floats, wall: Bools) -> tuple[Doubles, ...]:
    """Light in the middle of each square: its mean less what bending adds, a 24th of the second
    differences. The fit parts things much alike, so that it makes that 30 times as large.
    """
    green = light[..., 1].astype(np.float32)
    size = max(1, round(max(camera.width, camera.height) / ACROSS))
    shape = camera.width // size, camera.height // size
    cut = slice(0, shape[1] * size), slice(0, shape[0] * size)

    def mean(image: NDArray[np.floating]) -> NDArray[np.floating]:
        return cv2.resize(image[cut], shape, interpolation=cv2.INTER_AREA)

    level, whole = mean(green), mean(wall.astype(np.float32))
    spread = np.sqrt(np.maximum(mean(green * green) - level * level, 0))
    good = (whole > 0.999) & (level > DARK) & (mean((green > CLIPPED).astype(np.float32)) == 0)
    good &= spread < np.maximum(SMOOTH * level, 0.01)
    good[1:-1, 1:-1] &= cv2.erode(good.astype(np.uint8), np.ones((3, 3)))[1:-1, 1:-1] > 0
    good[[0, -1]] = good[:, [0, -1]] = False
    level = level - cv2.Laplacian(level, cv2.CV_32F, ksize=1) / np.float32(24)
    row, column = np.nonzero(good)
    xy = np.stack([column + 0.5, row + 0.5], axis=1) * size
    origin, rays = camera.rays(xy)
    far = -origin[:, 2] / np.where(rays[:, 2] == 0, np.inf, rays[:, 2])
    seen = far > 0
    xyz = camera.pose.apply(origin[seen] + far[seen, None] * rays[seen])
    facing = np.sign(camera.center[2])
    normal = np.broadcast_to(camera.pose.R[:, 2] * facing, xyz.shape)
    light_of = np.log(level[row, column][seen].astype(np.float64))
    return light_of, xyz, normal, corner_part(camera, xy[seen])
