"""What one photo says about points of the surface: a color each, and how much to trust it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.points.source import Chunk
from texproj.color.sampling.light_around import light_around
from texproj.color.sampling.pixel_lookup import depth_pixels, photo_pixels, read_colors, taken
from texproj.color.sampling.view import PhotoView
from texproj.color.weights.surface import SurfaceView

WEIGHT_ONE = 65535
"""The 16-bit value of weight 1; a weight above zero is stored as at least 1."""

MOSTLY = 0.8
"""Part of a chunk that must face the photo for the rest not to be sorted out first: that costs
more than to look up a few in vain."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Colors of the points that a photo sees.

    seen: (n,) bool which points of the chunk; packed: (m, 4) uint16 linear rgb (`view.WHITE`) and
    weight (`WEIGHT_ONE`), at least 1; around: (m,) see `bands.light_around`, or None.
    """

    seen: NDArray[np.bool_]
    packed: NDArray[np.uint16]
    around: NDArray[np.uint16] | None = None

    @property
    def rgb(self) -> NDArray[np.uint16]:
        """(m, 3) linear light (`view.WHITE`)."""
        return self.packed[:, :3]

    @property
    def weight(self) -> Floats:
        """(m,) weights in 0..1."""
        return self.packed[:, 3] * np.float32(1 / WEIGHT_ONE)


def sample(chunk: Chunk, surface: SurfaceView, view: PhotoView) -> Samples | None:
    """The photo's color at every point that it sees with a weight above zero; None if none."""
    weight = surface.weight.take(chunk.owner)
    facing = weight > 0
    count = np.count_nonzero(facing)
    if count == 0:
        return None
    part = chunk
    if sparse := count < MOSTLY * len(chunk):
        part, weight = chunk.take(np.flatnonzero(facing)), weight[facing]
    xy_px = project(part, weight, surface, view)
    seen, owner = weight > 0, part.owner
    count = np.count_nonzero(seen)
    if count == 0:
        return None
    if count < len(part):
        xy_px, weight, owner = taken(xy_px, seen), weight[seen], owner[seen]
    level = None if surface.level is None else surface.level.take(owner)
    rgb = read_colors(view, xy_px, level)
    around = light_around(view, rgb, xy_px, level)[:count] if view.soft else None
    if sparse:
        facing[facing] = seen
        seen = facing
    return Samples(seen, with_weight(rgb, weight), around)


def with_weight(rgb: NDArray[np.uint16], weight: Floats) -> NDArray[np.uint16]:
    """(n, 4) the first n colors of (rows, ROW, 3), each with its weight (n,)."""
    packed = np.empty((*rgb.shape[:2], 4), np.uint16)
    cv2.mixChannels([rgb], [packed], [0, 0, 1, 1, 2, 2])
    packed = packed.reshape(-1, 4)[: len(weight)]
    np.maximum(weight * np.float32(WEIGHT_ONE), 1, out=packed[:, 3], casting="unsafe")
    return packed


def project(chunk: Chunk, weight: Floats, surface: SurfaceView, view: PhotoView) -> Floats:
    """Where the points are in the photo; their weights (n,) are multiplied, in place, by what the
    picture is worth there, 0 = unseen.

    Returns (rows, ROW, 2) float32 OpenCV pixels (the top-left pixel's center is 0) of the
    full-size photo, of which the first n count.
    """
    in_depth, depth = depth_pixels(chunk.xyz, surface.origin, view.depth_camera)
    nearest = surface.nearer.take(chunk.owner)
    nearest *= depth
    seen = cv2.remap(view.depth, in_depth, None, cv2.INTER_NEAREST, borderValue=-1)
    visible = nearest <= seen.reshape(-1)[: len(chunk)]
    visible &= depth > 0
    weight *= visible
    if view.trust is not None:
        trust = cv2.remap(view.trust, in_depth, None, cv2.INTER_NEAREST, borderValue=0)
        weight *= trust.reshape(-1)[: len(chunk)]
    return photo_pixels(in_depth, view)
