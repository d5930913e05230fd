"""What one photo says about points of the surface: a color each, and how much to trust it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.color.lookup import depth_pixels, photo_pixels, read_colors, rescaled
from texproj.color.points import Chunk, Floats
from texproj.color.sight import Sight
from texproj.color.view import PhotoView

WEIGHT_ONE = 65535
"""The 16-bit value of weight 1; a weight above zero is stored as at least 1."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Colors of the points that a photo sees.

    seen: (n,) bool which points of the chunk; packed: (m, 4) uint16 linear rgb (`view.WHITE`) and
    weight (`WEIGHT_ONE`), at least 1.
    """

    seen: NDArray[np.bool_]
    packed: NDArray[np.uint16]

    @property
    def rgb(self) -> NDArray[np.uint16]:
        """(m, 3) linear light (`view.WHITE`)."""
        return self.packed[:, :3]

    @property
    def weight(self) -> Floats:
        """(m,) weights in 0..1."""
        return self.packed[:, 3] * np.float32(1 / WEIGHT_ONE)


def sample(chunk: Chunk, sight: Sight, view: PhotoView) -> Samples | None:
    """The photo's color at every point that it sees with a weight above zero; None if none."""
    facing = sight.weight[chunk.owner] > 0
    count = np.count_nonzero(facing)
    if count == 0:
        return None
    part = chunk if count > len(chunk) // 2 else Chunk(chunk.xyz[facing], chunk.owner[facing])
    xy_px, weight = project(part, sight, view)
    seen = weight > 0
    if not seen.any():
        return None
    packed = np.empty((len(seen), 4), np.uint16)
    packed[:, :3] = read_colors(view, xy_px, sight.level[part.owner])[: len(seen)]
    np.maximum(weight * np.float32(WEIGHT_ONE), 1, out=packed[:, 3], casting="unsafe")
    if not seen.all():
        packed = packed.view(np.uint64)[seen].view(np.uint16).reshape(-1, 4)
    if part is not chunk:
        facing[facing] = seen
        seen = facing
    return Samples(seen, packed)


def project(chunk: Chunk, sight: Sight, view: PhotoView) -> tuple[Floats, Floats]:
    """Where the points are in the photo, and their weights, 0 = unseen.

    Returns (rows, ROW, 2) float32 OpenCV pixels (the top-left pixel's center is 0) of the
    full-size photo, of which the first n count; (n,) float32.
    """
    n = len(chunk)
    in_depth, depth = depth_pixels(chunk.xyz, sight.origin, view.depth_camera)
    nearest = depth * sight.nearer[chunk.owner]
    hull = cv2.remap(view.hull, in_depth, None, cv2.INTER_NEAREST, borderValue=(-1, 0))
    hull = hull.reshape(-1, 2)[:n]
    visible = nearest <= hull[:, 0]
    visible &= depth > 0
    weight = sight.weight[chunk.owner]
    weight *= hull[:, 1]
    weight *= visible
    xy_px = photo_pixels(in_depth, view)
    if view.trust is not None:
        small = rescaled(xy_px, view.trust.shape, view.camera)
        trust = cv2.remap(view.trust, small, None, cv2.INTER_NEAREST, borderValue=0)
        weight *= trust.reshape(-1)[:n]
    return xy_px, weight
