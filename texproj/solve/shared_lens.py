"""Intrinsics that several cameras have in common, as parameters of one least-squares problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera, Intrinsics
from texproj.solve.reprojection import intrinsic_step, intrinsic_value

FIXED_POINT_STEPS = 4
"""Of the undistortion from a guess that is a part of a percent off: each leaves a tenth."""


@dataclass(frozen=True, eq=False)
class SharedIntrinsics:
    """Intrinsics of groups of cameras. names: of `INTRINSIC_NAMES`; group: (cameras,) number of
    each camera's group; value, sigma: (groups, names) what is known of them beforehand, as the
    solver sees it, and its standard deviation; free: (groups, names) bool, which are solved.
    """

    names: tuple[str, ...]
    group: NDArray[np.intp]
    value: Doubles
    sigma: Doubles
    free: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class LensParameters:
    """All shared intrinsics, one column of the problem for each name of each group, block by
    block; a camera has one column for each name.
    """

    blocks: tuple[SharedIntrinsics, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """What a camera's columns are."""
        return tuple(name for block in self.blocks for name in block.names)

    @property
    def count(self) -> int:
        """Number of parameters."""
        return sum(block.value.size for block in self.blocks)

    @cached_property
    def columns(self) -> NDArray[np.intp]:
        """(cameras, names) number of each camera's parameters."""
        first, out = 0, []
        for block in self.blocks:
            width = len(block.names)
            out.append(first + block.group[:, None] * width + np.arange(width))
            first += block.value.size
        return np.concatenate(out, axis=1)

    @property
    def free(self) -> NDArray[np.bool_]:
        """(parameters,) which are solved."""
        return np.concatenate([block.free.ravel() for block in self.blocks])

    def step(self, k: int, intrinsics: Intrinsics, delta: Doubles) -> Intrinsics:
        """The intrinsics of camera k, moved by the (parameters,) `delta`."""
        for name, column in zip(self.names, self.columns[k], strict=True):
            if delta[column]:
                intrinsics = intrinsic_step(intrinsics, name, delta[column])
        return intrinsics

    def prior(self, cameras: Sequence[Camera]) -> tuple[Doubles, Doubles]:
        """((parameters,) deviation from what is known over its sigma, (parameters,) 1 / sigma);
        zero and one for what is not solved.
        """
        value, sigma = [], []
        for block in self.blocks:
            for g in range(len(block.value)):
                lens = cameras[int(np.flatnonzero(block.group == g)[0])].intrinsics
                now = np.array([intrinsic_value(lens, name) for name in block.names])
                scale = np.where(block.free[g], block.sigma[g], 1.0)
                value.append(np.where(block.free[g], (now - block.value[g]) / scale, 0.0))
                sigma.append(scale)
        return np.concatenate(value), 1 / np.concatenate(sigma)


def ideal_of(lens: Intrinsics, xy_px: Doubles, guess: Doubles) -> Doubles:
    """(n, 2) ideal coordinates x/z, y/z of pixels (n, 2), from (n, 2) those of a lens that differs
    by a part of a percent.

    Fixed-point iteration; `Intrinsics.undistort` needs no guess and takes ten times as long.
    """
    target = (xy_px - (lens.cx, lens.cy)) / (lens.fx, lens.fy)
    if not lens.distorted:
        return target
    if lens.is_fisheye:  # its outer pixels are far from the identity
        return lens.undistort(target)
    ideal = guess
    for _ in range(FIXED_POINT_STEPS):
        ideal = ideal - (lens.distort(ideal) - target)
    return ideal
