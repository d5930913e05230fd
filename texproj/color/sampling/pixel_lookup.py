"""Pixel positions of points, and values there. Positions are OpenCV's: the top-left pixel's center
is (0, 0), half a pixel off everything outside of this module.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.sampling.view import LENS_CELL, PhotoView, linear16
from texproj.opencv import FAR_OUTSIDE

Colors = NDArray[np.uint16]

ROW = 256
"""Lookups are arranged in rows of this many, since OpenCV takes at most 32767 columns."""


def depth_pixels(xyz: Floats, origin: NDArray[np.float64], camera: Camera) -> tuple[Floats, Floats]:
    """(rows, ROW, 2) positions of points (n, 3) in a pinhole camera's picture, and (n,) depth.

    xyz is relative to `origin`, which is taken into the camera's frame in float64.
    """
    K, R, t = camera.intrinsics.K, camera.pose.R, camera.pose.apply(origin[None])[0]
    K[:2, 2] -= 0.5
    matrix = np.concatenate([K @ R, (K @ t)[:, None]], axis=1).astype(np.float32)
    homogeneous = cv2.transform(xyz.reshape(-1, 1, 3), matrix).reshape(-1, 3)
    depth = homogeneous[:, 2].copy()  # it is read several times
    maps = np.full((-(-len(xyz) // ROW) * ROW, 2), FAR_OUTSIDE, np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / depth
        np.multiply(homogeneous[:, 0], inverse, out=maps[: len(xyz), 0])
        np.multiply(homogeneous[:, 1], inverse, out=maps[: len(xyz), 1])
    return maps.reshape(-1, ROW, 2), depth


def photo_pixels(in_depth: Floats, view: PhotoView) -> Floats:
    """Positions in the full-size photo, through the lens, from those in the depth image."""
    d, k = view.depth_camera.intrinsics, view.camera.intrinsics
    sx, sy = k.fx / d.fx, k.fy / d.fy
    offset = k.cx - 0.5 - (d.cx - 0.5) * sx, k.cy - 0.5 - (d.cy - 0.5) * sy
    straight = affine(in_depth, (sx, sy), offset)
    if view.lens is None:
        return straight
    node = affine(in_depth, (1 / LENS_CELL, 1 / LENS_CELL), (0.5 + 0.5 / LENS_CELL,) * 2)
    shift = cv2.remap(view.lens, node, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return straight + shift


def rescaled(xy_px: Floats, shape: tuple[int, ...], camera: Camera) -> Floats:
    """Positions in a smaller copy of the photo."""
    sx, sy = shape[1] / camera.width, shape[0] / camera.height
    return affine(xy_px, (sx, sy), (0.5 * sx - 0.5, 0.5 * sy - 0.5))


def affine(maps: Floats, scale: tuple[float, float], offset: tuple[float, float]) -> Floats:
    """Positions times `scale` plus `offset`, per axis."""
    matrix = np.array([[scale[0], 0, offset[0]], [0, scale[1], offset[1]]], np.float32)
    return cv2.transform(maps, matrix)


def taken(maps: Floats, rows: NDArray[np.intp]) -> Floats:
    """Some of the positions, in rows of `ROW` again."""
    out = np.full((-(-len(rows) // ROW) * ROW, 2), FAR_OUTSIDE, np.float32)
    out.view(np.uint64)[: len(rows), 0] = maps.view(np.uint64).reshape(-1).take(rows)
    return out.reshape(-1, ROW, 2)


def read_colors(view: PhotoView, xy_px: Floats, level: NDArray[np.int8] | None) -> Colors:
    """(rows, ROW, 3) linear colors at full-size positions, each from its pyramid level; all from
    the first where `level` is None.
    """

    def read(maps: Floats, number: int) -> Colors:
        image = view.levels[number]
        maps = maps if number == 0 else rescaled(maps, image.shape, view.camera)
        border = cv2.BORDER_REPLICATE
        return linear16(cv2.remap(image, maps, None, cv2.INTER_CUBIC, borderMode=border))

    return by_level(read, xy_px, level)


def by_level(
    read: Callable[[Floats, int], NDArray[Any]], xy_px: Floats, level: NDArray[np.int8] | None
) -> NDArray[Any]:
    """(rows, ROW, ...) what `read` finds at full-size positions in the pyramid level of each: all
    in the one that most have, then the others in theirs.
    """
    if level is None or not level.any():
        return read(xy_px, 0)
    count = np.bincount(level)
    usual = int(count.argmax())
    values = read(xy_px, usual)
    flat = values.reshape(-1, *values.shape[2:])
    for number in np.flatnonzero(count):
        if number != usual:
            chosen = np.flatnonzero(level == number)
            found = read(taken(xy_px, chosen), int(number))
            flat[chosen] = found.reshape(-1, *values.shape[2:])[: len(chosen)]
    return values
