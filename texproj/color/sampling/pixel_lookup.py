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

TO_NODE = (1 / LENS_CELL,) * 2, (0.5 + 0.5 / LENS_CELL,) * 2
"""Scale and offset from the depth image to the table of lens displacements."""


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
    scale, offset = _straight(view)
    xy_px = affine(in_depth, scale, offset)
    if view.lens is None:
        return xy_px
    node = affine(in_depth, *TO_NODE)
    shift = cv2.merge([
        cv2.remap(part, node, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for part in view.lens
    ])  # fmt: skip
    return cv2.add(xy_px, shift, dst=xy_px)


def pixels_in_photo(view: PhotoView) -> tuple[Floats, Floats]:
    """Where all pixels of the depth image are in the full-size photo: (h, w) across and down."""
    width, height = view.depth_camera.width, view.depth_camera.height
    (sx, sy), (x, y) = _straight(view)
    across = (np.arange(width) * sx + x).astype(np.float32)[None]
    down = (np.arange(height) * sy + y).astype(np.float32)[:, None]
    if view.lens is None:
        whole = np.broadcast_to(across, (height, width)), np.broadcast_to(down, (height, width))
        return np.ascontiguousarray(whole[0]), np.ascontiguousarray(whole[1])
    (scale, _), (offset, _) = TO_NODE
    to_node = np.array([[scale, 0, offset], [0, scale, offset]])
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    right, below = (
        cv2.warpAffine(part, to_node, (width, height), None, how, cv2.BORDER_REPLICATE)
        for part in view.lens
    )
    right += across
    below += down
    return right, below


def _straight(view: PhotoView) -> tuple[tuple[float, float], tuple[float, float]]:
    """Scale and offset from the depth image to the full-size photo, but for the lens."""
    d, k = view.depth_camera.intrinsics, view.camera.intrinsics
    sx, sy = k.fx / d.fx, k.fy / d.fy
    return (sx, sy), (k.cx - 0.5 - (d.cx - 0.5) * sx, k.cy - 0.5 - (d.cy - 0.5) * sy)


def rescaled(xy_px: Floats, shape: tuple[int, ...], camera: Camera) -> Floats:
    """Positions in a smaller copy of the photo."""
    sx, sy = shape[1] / camera.width, shape[0] / camera.height
    return affine(xy_px, (sx, sy), (0.5 * sx - 0.5, 0.5 * sy - 0.5))


def affine(maps: Floats, scale: tuple[float, float], offset: tuple[float, float]) -> Floats:
    """Positions times `scale` plus `offset`, per axis."""
    matrix = np.array([[scale[0], 0, offset[0]], [0, scale[1], offset[1]]], np.float32)
    return cv2.transform(maps, matrix)


def taken(maps: Floats, chosen: NDArray[np.bool_]) -> Floats:
    """The chosen ones of the first (n,) positions, in rows of `ROW` again."""
    kept = maps.view(np.uint64).reshape(-1)[: len(chosen)][chosen]
    out = np.full((-(-len(kept) // ROW) * ROW, 2), FAR_OUTSIDE, np.float32)
    out.view(np.uint64)[: len(kept), 0] = kept
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
            chosen = level == number
            found = read(taken(xy_px, chosen), int(number))
            flat[: len(level)][chosen] = found.reshape(-1, *values.shape[2:])[: count[number]]
    return values
