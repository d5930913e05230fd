"""Patches of the surface under one photo, sought there in the colors of another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bools, Doubles, Floats, Index
from texproj.camera import Camera, Pose
from texproj.register.joint.gray import GrayPhoto
from texproj.register.joint.looking import looked_up, pixels_of
from texproj.register.joint.ties import (
    DEPTH_TOLERANCE,
    LEAST_SCORE,
    LEAST_SLANT,
    PATCH_PX,
    TieSearch,
    corner_grid,
    gradient_field,
)
from texproj.render import GBuffer, ideal_grid
from texproj.solve.joint import Ties
from texproj.solve.matching import SearchWindows, match_windows
from texproj.solve.orientation import DARK, Field


@dataclass(frozen=True)
class Density:
    """How many patches. along: one in each square of this part of the longer side, the most
    corner-like; most: sought of each pair, spread evenly.
    """

    along: int
    most: int


MARGIN_PX = 4
"""What smoothing and gradient need around a patch."""
SIDE_PX = PATCH_PX + 2 * MARGIN_PX
PROBES = np.array([MARGIN_PX, SIDE_PX // 2, SIDE_PX - 1 - MARGIN_PX])
"""Rows and columns of a patch that another photo must see."""


@dataclass(frozen=True, eq=False)
class SurfacePatches:
    """n squares of a photo with the surface under them.

    camera: reduced, from which they were rendered; center: (n, 2) x, y of their middle pixels;
    depth: (side, n, side) float32 of the surface, the squares beside each other; point, normal:
    (n, 3) float64 world, of the middle.
    """

    camera: Camera
    center: Index
    depth: Floats
    point: Doubles
    normal: Doubles

    @cached_property
    def xyz(self) -> Floats:
        """(3, side, n, side) the surface in camera axes: x, y, z apart."""
        grid = ideal_grid(self.camera.intrinsics)
        rows, columns = _squares(*self.center.T)
        both = grid.view(np.complex64).take(rows * grid.shape[1] + columns)  # x, y at once
        out = np.empty((3, *self.depth.shape), np.float32)
        np.multiply(both.real, self.depth, out=out[0])
        np.multiply(both.imag, self.depth, out=out[1])
        out[2] = self.depth
        return out

    @cached_property
    def probes(self) -> Floats:
        """(3, 3, n, 3) those of the places that another photo must see."""
        return np.ascontiguousarray(self.xyz[:, PROBES][..., PROBES])


@dataclass(frozen=True, eq=False)
class Sight:
    """What a photo sees. camera: for which depth was rendered; depth: (h, w) float32 at one of
    `stride` pixels along each side; 0 where the photo may not be used.
    """

    camera: Camera
    depth: Floats
    stride: int

    @classmethod
    def of(
        cls, camera: Camera, images: GBuffer, mask: NDArray[np.uint8] | None, longest: int
    ) -> Sight:
        """At most `longest` pixels along the longer side."""
        stride = max(1, round(max(camera.width, camera.height) / longest))
        every = (slice(stride // 2, None, stride),) * 2
        depth = images.require("depth")[every].copy()  # a view would keep the whole picture
        if mask is not None:
            depth[mask[every] == 0] = 0
        return cls(camera, depth, stride)

    def sees(self, xyz_in_cam: Floats) -> Bools:
        """(n, m, k) whether points (3, n, m, k) in camera axes are in the picture, and not hidden.

        The points are overwritten.
        """
        z = xyz_in_cam[2].copy()
        at = pixels_of(self.camera.intrinsics, xyz_in_cam)
        at -= np.float32(self.stride // 2)
        at /= np.float32(self.stride)
        there = looked_up(self.depth, at, cv2.INTER_NEAREST, cv2.BORDER_CONSTANT)
        with np.errstate(invalid="ignore"):
            out: Bools = np.abs(there - z) < DEPTH_TOLERANCE * z
        return out


@dataclass(frozen=True, eq=False)
class Partner:
    """A photo whose colors are looked at: its camera now, of the size of `photo`."""

    camera: Camera
    photo: GrayPhoto
    sight: Sight


def surface_patches(
    camera: Camera, photo: GrayPhoto, images: GBuffer, density: Density
) -> SurfacePatches:
    """Where the photo has corners on the surface. images: depth and normal from `camera`."""
    depth = images.require("depth")
    valid = np.isfinite(depth)
    if photo.mask is not None:
        valid &= photo.mask > 0
    kernel = np.ones((SIDE_PX, SIDE_PX), np.uint8)
    solid = cv2.erode(valid.astype(np.uint8), kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    corners = cv2.cornerMinEigenVal(np.log(photo.luma() + np.float32(DARK)), PATCH_PX)
    step = max(SIDE_PX // 2, round(max(camera.width, camera.height) / density.along))
    x, y = corner_grid(corners, solid > 0, step).T
    normal = images.require("normal")[y, x].astype(np.float64) @ camera.pose.R
    points = images.points(camera, y, x)
    return SurfacePatches(camera, np.stack([x, y], axis=1), depth[_squares(x, y)], points, normal)


def _squares(x: Index, y: Index) -> tuple[Index, Index]:
    """(side, n, 1) rows and (1, n, side) columns of the squares around pixels (n,)."""
    offset = np.arange(SIDE_PX) - SIDE_PX // 2
    return (y + offset[:, None])[:, :, None], (x[:, None] + offset)[None]


def find_ties(
    numbers: tuple[int, int], patches: SurfacePatches, seen: Index, searched: SearchWindows,
    partner: Partner,
) -> TieSearch:  # fmt: skip
    """Ties of photo j to photo i: the patches `seen` of i in the colors of j, sought in i. numbers:
    i and j; searched: where in the field of i each patch is sought.
    """
    if not len(seen):
        return TieSearch(_ties(numbers, patches, seen, np.zeros((0, 2)), partner), 0)
    matches = match_windows(partial(_in_colors_of, partner, patches), searched, seen)
    good = matches.score >= LEAST_SCORE
    chosen = seen[matches.patch[good]]
    return TieSearch(_ties(numbers, patches, chosen, matches.target_px[good], partner), len(seen))


def placed(patches: SurfacePatches, camera: Camera) -> tuple[Index, Index]:
    """((n, 2) pixels x, y where the camera sees the patches' middles, (m,) which of them it sees);
    0 where it does not.
    """
    xy = camera.project(patches.point)[0]
    inside = camera.inside(xy)
    return np.where(inside[:, None], xy, 0).astype(np.intp), np.flatnonzero(inside)


def seen_by(partner: Partner, patches: SurfacePatches, which: Index, most: int) -> Index:
    """(k,) those of the patches `which` that the other photo sees as a whole, `most` of them or
    fewer, spread evenly.
    """
    if not len(which):
        return which
    moved = _moved(
        patches.probes.take(which, axis=2), patches.camera.pose, partner.sight.camera.pose
    )
    seen = which[partner.sight.sees(moved).all(axis=(0, 2))]
    return seen[np.linspace(0, len(seen) - 1, min(most, len(seen))).round().astype(int)]


def _in_colors_of(partner: Partner, patches: SurfacePatches, which: Index) -> Field:
    """(k, size, size) gradient fields of the patches as the other photo shows them."""
    xyz = _moved(patches.xyz.take(which, axis=2), patches.camera.pose, partner.camera.pose)
    at = pixels_of(partner.camera.intrinsics, xyz).reshape(2, SIDE_PX, -1)
    field = gradient_field(partner.photo.at(at)).reshape(SIDE_PX, -1, SIDE_PX)
    return field[MARGIN_PX:-MARGIN_PX, :, MARGIN_PX:-MARGIN_PX].transpose(1, 0, 2)


def _moved(xyz: Floats, pose: Pose, other: Pose) -> Floats:
    """(3, ...) float32 points in the axes of one camera to those of another."""
    motion = other @ pose.inverse
    out: Floats = (motion.R.astype(np.float32) @ xyz.reshape(3, -1)).reshape(xyz.shape)
    for axis in range(3):
        out[axis] += np.float32(motion.t[axis])
    return out


def _ties(
    numbers: tuple[int, int], patches: SurfacePatches, which: Index, found_px: Doubles,
    partner: Partner,
) -> Ties:  # fmt: skip
    """Ties for patches seen in truth at `found_px`. Surface that photo j sees at a grazing angle is
    left out.
    """
    point, normal, camera = patches.point[which], patches.normal[which], partner.camera
    in_other = camera.pose.apply(point)
    ray = (point - camera.center) / np.linalg.norm(in_other, axis=1, keepdims=True)
    slant = np.abs((normal * ray).sum(1))
    ideal = in_other[:, :2] / in_other[:, 2:]
    to, source = (np.full(len(which), number) for number in numbers)
    ties = Ties(to, source, found_px, camera.project(point)[0], ideal, point, normal)
    return ties.at(slant > LEAST_SLANT)
