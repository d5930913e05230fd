"""Photos are made ready for sampling."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.sampling.light_around import soft_light
from texproj.color.sampling.pixel_lookup import pixels_in_photo
from texproj.color.sampling.view import WHITE, PhotoView, linear16
from texproj.color.weights.picture import picture_factors, silhouette_factor
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.render import Scene, pinhole_cover

DEPTH_SCALE = 0.5
"""Size of the depth image that decides what a photo sees, as a part of the photo's size:
silhouettes are feathered over more than its pixels."""

SILHOUETTE_FEATHER = 0.005
"""Width of the ramp beside depth discontinuities, as a part of the photo's diagonal."""
STRIP = 128
"""Rows of a reduced image that are made at once."""


def photo_view(photo: Photo, camera: Camera, scene: Scene, options: ColorOptions) -> PhotoView:
    """What `photo` sees of the scene. `camera` is that of the full-size photo."""
    depth_camera, depth = depth_seen(camera, scene)
    return view_of(photo, camera, depth_camera, depth, options)


def view_of(
    photo: Photo, camera: Camera, depth_camera: Camera, depth: Floats, options: ColorOptions
) -> PhotoView:
    """A photo with what its (full-size) camera sees, rendered before by `depth_seen`."""
    camera = camera.resized(photo.width, photo.height)
    levels = image_pyramid(photo)
    soft = soft_light(levels) if options.blend == "multi-band" else ()
    view = PhotoView(camera, depth_camera, depth, levels, info=photo.info, soft=soft)
    trust = in_depth_pixels(picture_trust(photo, levels, options), view)
    feather = silhouette_feather_px(camera, depth_camera, options)
    trust *= silhouette_factor(depth, depth_camera.intrinsics.fx, feather)
    return replace(view, trust=trust)


def silhouette_feather_px(camera: Camera, depth_camera: Camera, options: ColorOptions) -> float:
    """Pixels of the depth camera over which the silhouette's factor rises. camera: the photo's."""
    diagonal = float(np.hypot(camera.width, camera.height))
    return SILHOUETTE_FEATHER * diagonal * depth_camera.intrinsics.fx / camera.intrinsics.fx


def picture_trust(photo: Photo, levels: tuple[NDArray[Any], ...], options: ColorOptions) -> Floats:
    """(h, w) product of the picture's factors, in a reduced picture of the photo."""
    small = levels[1] if len(levels) > 1 else linear16(photo.pixels)
    factors = list(picture_factors(photo, small, WHITE, options).values())
    trust = factors.pop()
    for factor in factors:
        trust *= factor
    return trust


def in_depth_pixels(image: Floats, view: PhotoView) -> Floats:
    """A reduced picture of the photo, as the depth camera would see it; 0 outside of the photo."""
    if view.lens is None and image.shape == view.depth.shape:
        return image
    height, width = image.shape
    scales = width / view.camera.width, height / view.camera.height
    x, y = (
        at * np.float32(scale) + np.float32(0.5 * scale - 0.5)
        for at, scale in zip(pixels_in_photo(view), scales, strict=True)
    )
    return cv2.remap(image, x, y, cv2.INTER_LINEAR, borderValue=0)


def depth_seen(camera: Camera, scene: Scene) -> tuple[Camera, Floats]:
    """A pinhole camera that covers the picture, reduced by `DEPTH_SCALE`, and its depth image."""
    depth_camera = pinhole_cover(camera.scaled(DEPTH_SCALE))
    return depth_camera, scene.gbuffer(depth_camera, ("depth",)).require("depth")


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
