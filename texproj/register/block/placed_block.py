"""A block of photos put somewhere: what the least squares over patches of its photos moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.register.block.similarity import Similarity
from texproj.register.structure.view import Observation, StructureView
from texproj.solve.reprojection import projection_jacobian

FOCAL_SIGMA = 0.01
"""Relative standard deviation by which structure from motion may be off in all focal lengths at
once: photos of a flat thing hardly tell."""


@dataclass(frozen=True, eq=False)
class PlacedBlock:
    """world_from_block, and the logarithm of a factor common to all focal lengths."""

    world_from_block: Similarity
    log_focal: float = 0.0

    def camera(self, in_block: Camera) -> Camera:
        """A full-size camera of the block as one of the world."""
        k, zoom = in_block.intrinsics, float(np.exp(self.log_focal))
        k = replace(k, fx=k.fx * zoom, fy=k.fy * zoom)
        return self.world_from_block.camera(replace(in_block, intrinsics=k))

    def cameras(self, in_block: Mapping[str, Camera]) -> dict[str, Camera]:
        return {name: self.camera(camera) for name, camera in in_block.items()}


@dataclass(frozen=True, eq=False)
class Matched:
    """What one photo of the block showed of the mesh. in_block: its full-size camera."""

    in_block: Camera
    view: StructureView
    seen: Observation

    def camera(self, placed: PlacedBlock) -> Camera:
        """The camera in pixels of the level at which the photo was compared."""
        return self.view.camera_at(placed.camera(self.in_block), self.seen.rule.level)


@dataclass(frozen=True, eq=False)
class PatchFit:
    """Reprojection errors, pixels of the level, of patches found in several photos of one block.

    The eight unknowns: rotation (rad) about `pivot` (3,) world, shift in `unit`s of the world,
    logarithm of the scale, logarithm of the common focal factor.
    """

    photos: Sequence[Matched]
    pivot: Doubles
    unit: float

    @property
    def matches(self) -> int:
        return sum(len(photo.seen.matches) for photo in self.photos)

    def residual(self, x: PlacedBlock) -> Doubles:
        """(n, 2) projected minus found."""
        return np.concatenate(
            [
                photo.camera(x).project(photo.seen.xyz_in_world)[0] - photo.seen.matches.target_px
                for photo in self.photos
            ]
        )

    def jacobian(self, x: PlacedBlock) -> Doubles:
        """(n, 2, 8): moving the block is moving the surface the other way under fixed cameras."""
        return np.concatenate([self._derivative(photo, x) for photo in self.photos])

    def step(self, x: PlacedBlock, delta: Doubles) -> PlacedBlock:
        moved = x.world_from_block.step(delta[:7], self.pivot, self.unit)
        return PlacedBlock(moved, x.log_focal + float(np.clip(delta[7], -0.1, 0.1)))

    def prior(self, x: PlacedBlock) -> tuple[Doubles, Doubles]:
        jacobian = np.zeros((1, 8))
        jacobian[0, 7] = 1 / FOCAL_SIGMA
        return np.array([x.log_focal / FOCAL_SIGMA]), jacobian

    def _derivative(self, photo: Matched, x: PlacedBlock) -> Doubles:
        camera, xyz = photo.camera(x), photo.seen.xyz_in_world
        columns = projection_jacobian(camera, xyz, ("focal",))
        by_xyz = columns[:, :, 3:6] @ camera.pose.R
        arm = xyz - self.pivot
        turn = np.cross(arm[:, None], by_xyz)
        growth = -(by_xyz @ arm[..., None])
        return np.concatenate([-turn, -self.unit * by_xyz, growth, columns[:, :, 6:]], axis=2)
