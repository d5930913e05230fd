"""What one photo says about points of the surface: a color each, and how much to trust it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.color.points import Floats, SurfacePoints
from texproj.color.sight import sight_of
from texproj.color.view import PhotoView
from texproj.color.weights import factors_at
from texproj.options import ColorOptions


@dataclass(frozen=True, eq=False)
class Samples:
    """Colors of the points that a photo sees.

    index: (m,) numbers of the points in their chunk; rgb: (m, 3) uint16 linear light (`view.WHITE`); weight: (m,) float32 in (0, 1].
    """

    index: NDArray[np.intp]
    rgb: NDArray[np.uint16]
    weight: Floats


def sample(points: SurfacePoints, view: PhotoView, options: ColorOptions) -> Samples:
    """The photo's color at every point that it sees with a weight above zero."""
    sight = sight_of(points, view, options)
    weight = np.ones(len(sight.index), np.float32)
    for factor in factors_at(sight, view, options).values():
        weight *= factor
    used = np.flatnonzero(weight > 0)
    rgb = read_colors(view, sight.xy_px[used], sight.pixels[used])
    return Samples(points.index[sight.index[used]], rgb, weight[used])


def read_colors(view: PhotoView, xy_px: Floats, pixels: Floats) -> NDArray[np.uint16]:
    """(m, 3) linear colors, each from the pyramid level whose pixel fits the point's footprint."""
    top = len(view.levels) - 1
    level = np.clip(np.round(np.log2(np.maximum(pixels, 1)) - 0.2), 0, top).astype(np.int8)
    rgb = np.empty((len(xy_px), 3), np.uint16)
    for number in np.unique(level):
        chosen = np.flatnonzero(level == number)
        rgb[chosen] = bilinear(view.levels[number], xy_px[chosen], view.camera)
    return rgb


def bilinear(image: NDArray[np.uint16], xy_px: Floats, camera: Camera) -> NDArray[np.uint16]:
    """(m, 3) interpolated values at full-size pixels; the top-left pixel's center is (0.5, 0.5)."""
    h, w = image.shape[:2]
    scale = np.float32((w / camera.width, h / camera.height))
    xy = (xy_px * scale - np.float32(0.5)).reshape(1, -1, 2)
    width = 1 << 14  # cv2.remap takes no more than 32767 columns
    rows = -(-xy.shape[1] // width)
    padded = np.zeros((rows * width, 2), np.float32)
    padded[: xy.shape[1]] = xy[0]
    maps = padded.reshape(rows, width, 2)
    out = cv2.remap(image, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return out.reshape(-1, 3)[: xy.shape[1]]
