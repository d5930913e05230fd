"""Ties between two photos: patches of one, seen through the mesh from the other, found there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats, Index
from texproj.camera import Camera, Intrinsics
from texproj.opencv import FAR_OUTSIDE
from texproj.render import GBuffer, ideal_grid
from texproj.solve.joint import Ties
from texproj.solve.orientation import DARK, PRE_BLUR_PX, Field

PATCH_PX = 15
STEP_PX = 24
"""One patch in each square of this size: the most corner-like."""
RIM_PX = PATCH_PX // 2 + 1
LEAST_SCORE = 0.75
"""Normalized correlation of signed gradients at which a patch counts as found."""
DEPTH_TOLERANCE = 0.01
"""The other photo sees the same surface if the depths agree to this part."""
LEAST_SLANT = 0.2
"""Cosine between ray and normal below which a point's depth says too little about its place."""


@dataclass(frozen=True, eq=False)
class PhotoView:
    """One photo ready for comparison: its camera at the working size, its luma in 0..1, what the
    mesh looks like from there (depth, normal), and where it may be used.
    """

    camera: Camera
    gray: Floats
    images: GBuffer
    valid: NDArray[np.bool_]

    @cached_property
    def gradients(self) -> Field:
        return gradient_field(self.gray)

    @cached_property
    def corners(self) -> Floats:
        """(h, w) how well a patch around a pixel can be located."""
        return cv2.cornerMinEigenVal(np.log(self.gray + np.float32(DARK)), PATCH_PX)

    @cached_property
    def xyz_in_cam(self) -> NDArray[np.float32]:
        """(h, w, 3) the surface under each pixel, in camera axes; NaN where there is none."""
        depth = np.where(self.valid, self.images.require("depth"), np.nan)[..., None]
        ideal = ideal_grid(self.camera.intrinsics)
        return np.concatenate([ideal * depth, depth], axis=2).astype(np.float32)


class Lookup(Protocol):
    """The views by number of the photo."""

    def __getitem__(self, k: int, /) -> PhotoView: ...


@dataclass(frozen=True, eq=False)
class TieSearch:
    """Ties found between two photos, and how many were sought: patches on surface both see."""

    ties: Ties
    sought: int

    @property
    def support(self) -> float:
        """Share of the patches that were found."""
        return len(self.ties) / max(self.sought, 1)


def photo_view(
    camera: Camera, gray: Floats, images: GBuffer, mask: NDArray[np.uint8] | None
) -> PhotoView:
    """Bring a photo and its rendering together; mask: 0 = do not use."""
    valid = np.isfinite(images.require("depth"))
    if mask is not None:
        valid &= mask > 0
    return PhotoView(camera, gray, images, valid)


def gradient_field(gray: Floats) -> Field:
    """(h, w) complex: gradient of the logarithm, so that exposure does not matter."""
    smooth = cv2.GaussianBlur(np.log(gray + np.float32(DARK)), (0, 0), PRE_BLUR_PX)
    out = np.empty(gray.shape, np.complex64)
    out.real = cv2.Scharr(smooth, cv2.CV_32F, 1, 0, scale=1 / 32)
    out.imag = cv2.Scharr(smooth, cv2.CV_32F, 0, 1, scale=1 / 32)
    return out


def corner_grid(corners: Floats, valid: NDArray[np.bool_], step_px: int = STEP_PX) -> Index:
    """(n, 2) x, y of the most corner-like valid pixel of each square of the grid, but for squares
    with less than half the structure of the median one (nothing there can be located).
    """
    strength = np.where(valid, corners, 0)
    h, w = (n // step_px * step_px for n in corners.shape)
    squares = strength[:h, :w].reshape(h // step_px, step_px, w // step_px, step_px)
    cells = squares.transpose(0, 2, 1, 3).reshape(h // step_px, w // step_px, -1)
    best, where = cells.max(axis=2), cells.argmax(axis=2)
    used = best > 0
    if not used.any():
        return np.zeros((0, 2), np.intp)
    row, column = np.nonzero(best > 0.5 * np.median(best[used]))
    inner_y, inner_x = np.divmod(where[row, column], step_px)
    return np.stack([column * step_px + inner_x, row * step_px + inner_y], axis=1)


def warped(here: PhotoView, other: PhotoView) -> tuple[Floats, NDArray[np.bool_]]:
    """(h, w) luma of `other` in the picture of `here`, and where both see the same surface."""
    other_from_here = other.camera.pose @ here.camera.pose.inverse
    matrix = np.concatenate([other_from_here.R, other_from_here.t[:, None]], axis=1)
    xyz = cv2.transform(here.xyz_in_cam, matrix)
    depth = xyz[..., 2]
    at = _pixels(other.camera.intrinsics, xyz)
    outside = {"borderMode": cv2.BORDER_CONSTANT, "borderValue": 0}
    there = cv2.remap(other.images.require("depth"), at, None, cv2.INTER_NEAREST, **outside)
    usable = cv2.remap(other.valid.astype(np.uint8), at, None, cv2.INTER_NEAREST, **outside)
    with np.errstate(invalid="ignore"):
        shared = (usable > 0) & (np.abs(there - depth) < DEPTH_TOLERANCE * depth)
    gray = cv2.remap(other.gray, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.where(shared, gray, here.gray), shared


def _pixels(k: Intrinsics, xyz_in_cam: NDArray[np.float32]) -> NDArray[np.float32]:
    """(h, w, 2) where points are in the picture, from the center of its first pixel as OpenCV
    counts; far outside where they are not seen.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        ideal = xyz_in_cam[..., :2] / xyz_in_cam[..., 2:]
    if k.distorted:
        ideal = k.distort(ideal.reshape(-1, 2)).reshape(ideal.shape)
    at = ideal * np.array([k.fx, k.fy], np.float32) + np.array([k.cx, k.cy], np.float32) - 0.5
    seen = np.isfinite(at).all(axis=2, keepdims=True) & (xyz_in_cam[..., 2:] > 0)
    return np.where(seen, at, FAR_OUTSIDE).astype(np.float32)
