"""The points of a block of photos that are worth comparing with a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles, Floats, Index
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.scan_samples import middle_and_size
from texproj.register.block.similarity import Similarity
from texproj.register.block.subject import aim_of

MOST_ERROR_PX, LEAST_ANGLE_RAD = 1.5, np.radians(2.0)
"""Points with a larger reprojection error or a smaller angle between their rays are left out ..."""
LEAST_POINTS = 100
"""... unless fewer than this would be left; with fewer in all, the block has no shape."""
AIMED = 0.35
"""Radius of what the photos aim at, relative to their distance from it ..."""
MOST_AIMED = 0.7
"""... and the share of the points there from which on all points are as good."""
CELL = 1 / 16
"""Points closer to each other than this, sizes of the block, stand in line for each other."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """block_from_unit: from the frame in which the points have size 1 about the origin.

    xyz: (n, 3) float32 in that frame; any beginning of it is spread evenly over the shape.
    eye: (n, 3) a camera that saw each; toward: (n, 3) unit direction from the point to it.
    """

    block_from_unit: Similarity
    xyz: Floats
    eye: Floats
    toward: Floats

    def __len__(self) -> int:
        return len(self.xyz)

    @classmethod
    def of(cls, block: Reconstruction, seed: int = 0) -> Cloud:
        """The well measured points of a block."""
        return cls._made(block, _well_measured(block), seed)

    @classmethod
    def aimed_at(cls, block: Reconstruction, seed: int = 0) -> Cloud | None:
        """Only points around what the photos have in their middles; None where the photos do not
        look at one thing, or most points lie there anyway.
        """
        aim = aim_of(block.cameras)
        good = _well_measured(block)
        if aim is None:
            return None
        near = np.linalg.norm(block.points[good] - aim.middle, axis=1) < AIMED * aim.distance
        if near.sum() < LEAST_POINTS or near.mean() > MOST_AIMED:
            return None
        return cls._made(block, good[near], seed)

    @classmethod
    def _made(cls, block: Reconstruction, chosen: Index, seed: int) -> Cloud:
        rng = np.random.default_rng(seed)
        middle, size = middle_and_size(block.points[chosen])
        unit = (block.points[chosen] - middle) / size
        order = _evenly(unit, rng)
        centers = np.array([camera.center for camera in block.cameras])
        eye = (centers[_viewers(block, chosen[order], rng)] - middle) / size
        xyz = unit[order].astype(np.float32)
        ray = eye.astype(np.float32) - xyz
        toward = ray / np.maximum(np.linalg.norm(ray, axis=1), 1e-12)[:, None]
        return cls(Similarity(size, np.eye(3), middle), xyz, eye.astype(np.float32), toward)


def _well_measured(block: Reconstruction) -> Index:
    good = (block.error_px < MOST_ERROR_PX) & (block.angle_rad > LEAST_ANGLE_RAD)
    if good.sum() < LEAST_POINTS:
        good = np.ones(len(good), bool)
    return np.flatnonzero(good)


def _evenly(xyz: Doubles, rng: np.random.Generator) -> Index:
    """An order in which the first point of every cell comes first, then the second, and so on."""
    shuffled = rng.permutation(len(xyz))
    cell = np.unique(np.floor(xyz[shuffled] / CELL), axis=0, return_inverse=True)[1].ravel()
    by_cell = np.argsort(cell, kind="stable")
    ranked = cell[by_cell]
    first = np.searchsorted(ranked, ranked)
    turn = np.empty(len(xyz), np.intp)
    turn[by_cell] = np.arange(len(xyz)) - first
    return shuffled[np.argsort(turn, kind="stable")]


def _viewers(block: Reconstruction, points: Index, rng: np.random.Generator) -> Index:
    """(n,) for each of `points` the number of one of the cameras that saw it."""
    first, count = block.track_starts[points], np.diff(block.track_starts)[points]
    return block.observer[first + (rng.random(len(points)) * count).astype(np.intp)]
