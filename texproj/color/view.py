"""A photo made ready for sampling: its depth, its silhouettes, its image pyramid."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.options import ColorOptions
from texproj.photo import LINEAR_OF_SRGB8, Photo
from texproj.render import Scene, pinhole_cover

WHITE = 60000.0
"""The 16-bit value that stands for linear 1, with head-room for resampling and gains."""

LINEAR16_OF_SRGB8 = np.round(LINEAR_OF_SRGB8 * WHITE).astype(np.uint16)

DEPTH_JUMP_PX = 12.0
"""Depth steps between neighboring pixels larger than so many pixel footprints are silhouettes:
a plane seen at 85 degrees off its normal makes steps of 11."""


@dataclass(frozen=True, eq=False)
class PhotoView:
    """A photo, its camera and what it sees of the mesh.

    camera: of the photo's decoded size; levels: the photo in linear light, 16 bit (`WHITE`),
    each level half the size of the one before; depth_camera: pinhole, covers the photo;
    depth: (h, w) float32 along its axis, inf = nothing there; silhouette_px: (h, w) float32
    distance from the next depth discontinuity, in pixels of the photo;
    mask_px: the distance from the next masked pixel, in pixels of the photo, or None.
    """

    camera: Camera
    levels: tuple[NDArray[np.uint16], ...]
    depth_camera: Camera
    depth: NDArray[np.float32]
    silhouette_px: NDArray[np.float32]
    mask_px: NDArray[np.float32] | None

    @property
    def diagonal_px(self) -> float:
        return float(np.hypot(self.camera.width, self.camera.height))

    @cached_property
    def depth_pixel(self) -> float:
        """Pixels of the photo per pixel of the depth image."""
        return self.camera.intrinsics.fx / self.depth_camera.intrinsics.fx


def photo_view(photo: Photo, camera: Camera, scene: Scene, options: ColorOptions) -> PhotoView:
    """What `photo` sees of the scene. `camera` is that of the full-size photo."""
    view = bare_view(camera.resized(photo.width, photo.height), scene, options.depth_scale)
    return replace(
        view,
        levels=image_pyramid(photo),
        silhouette_px=silhouette_distance(view.depth, view.depth_camera.intrinsics.fx)
        * np.float32(view.depth_pixel),
        mask_px=mask_distance(photo.mask),
    )


def bare_view(camera: Camera, scene: Scene, depth_scale: float) -> PhotoView:
    """What `camera` sees of the scene, without the photo and what is made from it."""
    depth_camera = pinhole_cover(camera.scaled(depth_scale))
    depth = scene.gbuffer(depth_camera, ("depth",)).depth
    assert depth is not None
    return PhotoView(camera, (), depth_camera, depth, np.full_like(depth, 1e6), None)


def image_pyramid(photo: Photo, smallest: int = 32) -> tuple[NDArray[np.uint16], ...]:
    """The photo in linear light as 16-bit images, each half as large as the one before."""
    if photo.encoding == "srgb":
        image = cv2.LUT(photo.pixels, LINEAR16_OF_SRGB8)
    else:
        image = np.clip(photo.pixels * WHITE, 0, 65535).astype(np.uint16)
    levels = [image]
    while min(levels[-1].shape[:2]) >= 2 * smallest:
        levels.append(cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return tuple(levels)


def silhouette_distance(depth: NDArray[np.float32], focal_px: float) -> NDArray[np.float32]:
    """(h, w) distance in pixels from the next depth discontinuity or border of the mesh.

    A discontinuity is a step of more than `DEPTH_JUMP_PX` pixel footprints (depth / focal).
    """
    finite = np.where(np.isfinite(depth), depth, np.float32(1e30))
    kernel = np.ones((3, 3), np.uint8)
    near, far = cv2.erode(finite, kernel), cv2.dilate(finite, kernel)
    smooth = far - near <= near * np.float32(DEPTH_JUMP_PX / focal_px)
    if smooth.all():
        return np.full(depth.shape, np.float32(1e6))
    return cv2.distanceTransform(smooth.astype(np.uint8), cv2.DIST_L2, 3)


def mask_distance(mask: NDArray[np.uint8] | None) -> NDArray[np.float32] | None:
    """(h, w) distance in pixels from the next masked pixel; None without a mask or an empty one."""
    if mask is None or mask.all():
        return None
    return cv2.distanceTransform((mask > 0).astype(np.uint8), cv2.DIST_L2, 5)


def lookup(image: NDArray[np.float32], xy_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """(m,) value of the pixel that each position falls in."""
    h, w = image.shape
    column = np.minimum(xy_px[:, 0].astype(np.int32), w - 1)
    row = np.minimum(xy_px[:, 1].astype(np.int32), h - 1)
    return image.ravel()[row * w + column]
