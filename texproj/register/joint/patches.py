"""Patches of the surface under one photo, sought there in the colors of another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats, Index
from texproj.camera import Camera, Intrinsics, Pose
from texproj.opencv import FAR_OUTSIDE
from texproj.register.joint.gray import GrayPhoto
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
from texproj.solve.matching import SearchImage, match_windows
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
    depth: (n, side, side) float32 of the surface; point, normal: (n, 3) float64 world, of the
    middle.
    """

    camera: Camera
    center: Index
    depth: Floats
    point: Doubles
    normal: Doubles

    @cached_property
    def xyz(self) -> Floats:
        """(n, side, side, 3) the surface in camera axes."""
        x, y = self.center.T
        rows, columns = _squares(x, y)
        ideal = ideal_grid(self.camera.intrinsics)[rows, columns]
        depth = self.depth[..., None]
        return np.concatenate([ideal * depth, depth], axis=3)


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

    def sees(self, xyz_in_cam: Floats) -> NDArray[np.bool_]:
        """(n, m) whether points (n, m, 3) in camera axes are in the picture, and not hidden."""
        at = pixels_of(self.camera.intrinsics, xyz_in_cam)
        at = (at - self.stride // 2) / np.float32(self.stride)
        there = cv2.remap(
            self.depth, at, None, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=0
        )
        z = xyz_in_cam[..., 2]
        with np.errstate(invalid="ignore"):
            out: NDArray[np.bool_] = np.abs(there - z) < DEPTH_TOLERANCE * z
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
    """(n, side, 1) rows and (n, 1, side) columns of the squares around pixels (n,)."""
    offset = np.arange(SIDE_PX) - SIDE_PX // 2
    return (y[:, None] + offset)[:, :, None], (x[:, None] + offset)[:, None, :]


def find_ties(
    numbers: tuple[int, int], patches: SurfacePatches, camera: Camera, searched: SearchImage,
    partner: Partner, most: int,
) -> TieSearch:  # fmt: skip
    """Ties of photo j to photo i: the patches of i in the colors of j, sought in i where the
    camera puts them, at most `most` of them. numbers: i and j; camera: that of i now; searched: the
    field of i.
    """
    here, inside = _placed(patches, camera)
    seen = np.flatnonzero(inside)
    seen = seen[_seen(patches, seen, partner.sight)]
    seen = seen[np.linspace(0, len(seen) - 1, min(most, len(seen))).round().astype(int)]
    if not len(seen):
        return TieSearch(_ties(numbers, patches, seen, np.zeros((0, 2)), partner), 0)
    windows = _in_colors_of(partner, patches, seen)
    matches = match_windows(windows, searched, here[seen])
    good = matches.score >= LEAST_SCORE
    chosen = seen[matches.patch[good]]
    return TieSearch(_ties(numbers, patches, chosen, matches.target_px[good], partner), len(seen))


def _placed(patches: SurfacePatches, camera: Camera) -> tuple[Index, NDArray[np.bool_]]:
    """((n, 2) pixels x, y where the camera sees the patches' middles, (n,) is that inside)."""
    xy = camera.project(patches.point)[0]
    inside = camera.inside(xy)
    return np.where(inside[:, None], xy, 0).astype(np.intp), inside


def _seen(patches: SurfacePatches, which: Index, sight: Sight) -> NDArray[np.bool_]:
    """(k,) whether the other photo sees the whole patch."""
    probes = patches.xyz[which[:, None, None], PROBES[:, None], PROBES].reshape(len(which), -1, 3)
    if not len(which):
        return np.zeros(0, np.bool_)
    seen = sight.sees(_moved(probes, patches.camera.pose, sight.camera.pose))
    return np.all(seen, axis=1)


def _in_colors_of(partner: Partner, patches: SurfacePatches, which: Index) -> Field:
    """(k, size, size) gradient fields of the patches as the other photo shows them."""
    xyz = patches.xyz[which].reshape(-1, SIDE_PX, 3)
    at = pixels_of(partner.camera.intrinsics, _moved(xyz, patches.camera.pose, partner.camera.pose))
    luma = partner.photo.at(at)
    field = gradient_field(luma).reshape(len(which), SIDE_PX, SIDE_PX)
    return field[:, MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]


def _moved(xyz: Floats, pose: Pose, other: Pose) -> Floats:
    """(n, m, 3) float32 points in the axes of one camera to those of another."""
    motion = other @ pose.inverse
    return cv2.transform(xyz, np.concatenate([motion.R, motion.t[:, None]], axis=1))


def pixels_of(k: Intrinsics, xyz_in_cam: Floats) -> Floats:
    """(n, m, 2) float32 where points are in the picture, from the center of its first pixel as
    OpenCV counts; far outside where they are not seen.
    """
    x, y, z = (np.ascontiguousarray(xyz_in_cam[..., axis]) for axis in range(3))
    with np.errstate(invalid="ignore", divide="ignore"):
        x, y = x / z, y / z
    if k.distorted:
        bent = k.distort_each(x.ravel(), y.ravel())
        x, y = (side.astype(np.float32).reshape(z.shape) for side in bent)
    at = np.empty((*z.shape, 2), np.float32)
    at[..., 0] = x * np.float32(k.fx) + np.float32(k.cx) - np.float32(0.5)
    at[..., 1] = y * np.float32(k.fy) + np.float32(k.cy) - np.float32(0.5)
    at[~(np.isfinite(at[..., 0]) & np.isfinite(at[..., 1]) & (z > 0))] = FAR_OUTSIDE
    return at


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
