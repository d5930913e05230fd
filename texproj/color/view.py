"""A photo made ready for sampling: its depth, its image pyramid, what in it can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.color.pictures import picture_factors, silhouette_factor
from texproj.color.points import Floats
from texproj.options import ColorOptions
from texproj.photo import LINEAR_OF_SRGB8, Photo
from texproj.render import Scene, pinhole_cover

WHITE = 60000.0
"""The 16-bit value that stands for linear 1, with head-room for resampling and gains."""

LINEAR16_OF_SRGB8 = np.round(LINEAR_OF_SRGB8 * WHITE).astype(np.uint16)

LENS_CELL = 8
"""Pixels of the depth image per node of the table of lens displacements."""


@dataclass(frozen=True, eq=False)
class PhotoView:
    """A photo, its camera and what it sees of the mesh.

    camera: of the photo's decoded size; levels: the photo in linear light, 16 bit (`WHITE`),
    each level half the size of the one before; depth_camera: pinhole, covers the photo;
    hull: (h, w, 2) float32 in the pixels of the depth camera: depth along its axis (inf = nothing
    there) and the silhouette factor; trust: (h, w) float32 product of the picture factors, in a
    reduced picture of the photo.
    """

    camera: Camera
    depth_camera: Camera
    hull: Floats
    levels: tuple[NDArray[np.uint16], ...] = ()
    trust: Floats | None = None

    @cached_property
    def lens(self) -> Floats | None:
        """(h, w, 2) displacement by the lens, pixels of the photo, at nodes `LENS_CELL` pixels of
        the depth image apart, the first node at (-LENS_CELL/2, -LENS_CELL/2); None without.
        """
        if not self.camera.intrinsics.distorted:
            return None
        k, d = self.camera.intrinsics, self.depth_camera.intrinsics
        x = (np.arange(-(-d.width // LENS_CELL) + 2) - 0.5) * LENS_CELL
        y = (np.arange(-(-d.height // LENS_CELL) + 2) - 0.5) * LENS_CELL
        ideal = np.stack(np.meshgrid((x - d.cx) / d.fx, (y - d.cy) / d.fy), axis=-1)
        bent = k.distort(ideal.reshape(-1, 2)).reshape(ideal.shape)
        shift = (bent - ideal) * (k.fx, k.fy)
        return np.where(np.isfinite(shift), shift, 1e6).astype(np.float32)


def photo_view(photo: Photo, camera: Camera, scene: Scene, options: ColorOptions) -> PhotoView:
    """What `photo` sees of the scene. `camera` is that of the full-size photo."""
    camera = camera.resized(photo.width, photo.height)
    depth_camera, depth = depth_seen(camera, scene, options.depth_scale)
    focal, diagonal = depth_camera.intrinsics.fx, np.hypot(camera.width, camera.height)
    feather = options.silhouette_feather * diagonal * focal / camera.intrinsics.fx
    levels = image_pyramid(photo)
    small = levels[min(1, len(levels) - 1)]
    trust = np.ones(small.shape[:2], np.float32)
    for factor in picture_factors(photo, small, WHITE, options).values():
        trust *= factor
    hull = np.dstack([depth, silhouette_factor(depth, focal, feather)])
    return PhotoView(camera, depth_camera, hull, levels, trust)


def depth_seen(camera: Camera, scene: Scene, scale: float) -> tuple[Camera, Floats]:
    """A pinhole camera that covers the picture, reduced by `scale`, and the depth that it sees."""
    depth_camera = pinhole_cover(camera.scaled(scale))
    depth = scene.gbuffer(depth_camera, ("depth",)).depth
    assert depth is not None
    return depth_camera, depth


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
