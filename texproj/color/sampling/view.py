"""A photo ready for sampling: its depth, its image pyramid, what in it can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.photo import LINEAR_OF_SRGB8, PhotoInfo

WHITE = 60000.0
"""The 16-bit value that stands for linear 1, with head-room for resampling and gains."""

LINEAR16_OF_SRGB8 = np.round(LINEAR_OF_SRGB8 * WHITE).astype(np.uint16)

LENS_CELL = 8
"""Pixels of the depth image per node of the table of lens displacements."""


@dataclass(frozen=True, eq=False)
class PhotoView:
    """A photo, its camera and what it sees of the mesh.

    camera: of the photo's decoded size; levels: the photo, then linear 16-bit images (`WHITE`),
    each half as large as the one before; the first may be 8-bit sRGB;
    depth_camera: pinhole, covers the photo;
    depth: (h, w) float32 along the axis of the depth camera (inf = nothing there);
    trust: (h, w) float32 product of the silhouette's and the picture's factors, in the pixels of
    the depth camera too; None = 1 everywhere; info: what the photo's header says;
    soft: light around the pixels of each level, see `bands.soft_light`, or none;
    shift: (h, w, 2) float32 displacement over the whole picture, pixels of the photo, or None:
    what the camera expects at a place is seen that much away.
    """

    camera: Camera
    depth_camera: Camera
    depth: Floats
    levels: tuple[NDArray[Any], ...] = ()
    trust: Floats | None = None
    info: PhotoInfo | None = None
    soft: tuple[Floats, ...] = ()
    shift: Floats | None = None

    @cached_property
    def lens(self) -> Floats | None:
        """(2, h, w) displacement across and down by the lens and `shift`, pixels of the photo, at
        nodes `LENS_CELL` pixels of the depth image apart, the first node at (-LENS_CELL/2,
        -LENS_CELL/2); None without. Two images, since OpenCV reads two of one channel in two
        thirds of the time that it takes for one of two.
        """
        if not self.camera.intrinsics.distorted and self.shift is None:
            return None
        k, d = self.camera.intrinsics, self.depth_camera.intrinsics
        x = (np.arange(-(-d.width // LENS_CELL) + 2) - 0.5) * LENS_CELL
        y = (np.arange(-(-d.height // LENS_CELL) + 2) - 0.5) * LENS_CELL
        ideal = np.stack(np.meshgrid((x - d.cx) / d.fx, (y - d.cy) / d.fy), axis=-1)
        bent = k.distort(ideal.reshape(-1, 2)).reshape(ideal.shape)
        lens = (bent - ideal) * (k.fx, k.fy)
        if self.shift is not None:
            lens += self._shift_at(bent * (k.fx, k.fy) + (k.cx, k.cy))
        finite = np.where(np.isfinite(lens), lens, 1e6)
        return np.ascontiguousarray(np.moveaxis(finite, -1, 0), np.float32)

    def _shift_at(self, xy_px: NDArray[np.float64]) -> Floats:
        """`shift` at positions in the photo, from its top-left corner."""
        assert self.shift is not None
        size = np.array(self.shift.shape[1::-1])
        at = xy_px * (size / (self.camera.width, self.camera.height)) - 0.5
        at = np.nan_to_num(at, nan=-1.0).clip(-1, size).astype(np.float32)
        return cv2.remap(self.shift, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def linear16(pixels: NDArray[Any]) -> NDArray[np.uint16]:
    """sRGB uint8, linear float32 or linear uint16 (`WHITE`) values as the latter."""
    if pixels.dtype == np.uint8:
        return cv2.LUT(pixels, LINEAR16_OF_SRGB8)
    if pixels.dtype == np.uint16:
        return pixels
    return np.clip(pixels * np.float32(WHITE), 0, 65535).astype(np.uint16)
