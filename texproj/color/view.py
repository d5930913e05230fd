"""A photo made ready for sampling: its depth, its image pyramid, what in it can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

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

STRIP = 128
"""Rows of a reduced image that are made at once."""

LENS_CELL = 8
"""Pixels of the depth image per node of the table of lens displacements."""


@dataclass(frozen=True, eq=False)
class PhotoView:
    """A photo, its camera and what it sees of the mesh.

    camera: of the photo's decoded size; levels: see `image_pyramid`;
    depth_camera: pinhole, covers the photo;
    hull: (h, w, 2) float32 in the pixels of the depth camera: depth along its axis (inf = nothing
    there) and the silhouette factor; trust: (h, w) float32 product of the picture factors, in a
    reduced picture of the photo.
    """

    camera: Camera
    depth_camera: Camera
    hull: Floats
    levels: tuple[NDArray[Any], ...] = ()
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
    depth_camera, depth = depth_seen(camera, scene, options.depth_scale)
    return view_of(photo, camera, depth_camera, depth, options)


def view_of(
    photo: Photo, camera: Camera, depth_camera: Camera, depth: Floats, options: ColorOptions
) -> PhotoView:
    """A photo with what its (full-size) camera sees, rendered before by `depth_seen`."""
    camera = camera.resized(photo.width, photo.height)
    focal, diagonal = depth_camera.intrinsics.fx, np.hypot(camera.width, camera.height)
    feather = options.silhouette_feather * diagonal * focal / camera.intrinsics.fx
    levels = image_pyramid(photo)
    small = levels[1] if len(levels) > 1 else linear16(photo.pixels)
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


def image_pyramid(photo: Photo, smallest: int = 32) -> tuple[NDArray[Any], ...]:
    """The photo, then linear 16-bit images (`WHITE`), each half as large as the one before. The
    first is kept as it is if it has 8 bits (sRGB), for half the memory.
    """
    first = photo.pixels if photo.encoding == "srgb" else linear16(photo.pixels)
    levels: list[NDArray[Any]] = [first]
    while min(levels[-1].shape[:2]) >= 2 * smallest:
        levels.append(_halved(levels[-1]))
    return tuple(levels)


def _halved(image: NDArray[Any]) -> NDArray[np.uint16]:
    """The linear image of half the size, area averaged, strip by strip."""
    height, width = image.shape[0] // 2, image.shape[1] // 2
    out = np.empty((height, width, 3), np.uint16)
    for top in range(0, height, STRIP):
        rows = slice(top, min(top + STRIP, height))
        part = linear16(image[2 * rows.start : 2 * rows.stop, : 2 * width])
        size = (width, rows.stop - rows.start)
        cv2.resize(part, size, dst=out[rows], interpolation=cv2.INTER_AREA)
    return out


def linear16(pixels: NDArray[Any]) -> NDArray[np.uint16]:
    """sRGB uint8, linear float32 or linear uint16 (`WHITE`) values as the latter."""
    if pixels.dtype == np.uint8:
        return cv2.LUT(pixels, LINEAR16_OF_SRGB8)
    if pixels.dtype == np.uint16:
        return pixels
    return np.clip(pixels * np.float32(WHITE), 0, 65535).astype(np.uint16)
