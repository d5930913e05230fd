"""What in a picture can be trusted: named factors in 0..1, as images.

After the masks of Callieri, Cignoni, Corsini, Scopigno, "Masked photo blending", Computers &
Graphics 2008; the formulas are ours.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.options import ColorOptions
from texproj.photo import Photo

BORDER_FEATHER = 0.03
"""Width of the ramp at a photo's border, as a part of its diagonal."""
MASK_FEATHER = 0.003
"""Width of the ramp beside a mask, as a part of the photo's diagonal."""
DARK_WEIGHT = 0.2
"""Weight of samples where the photo is hardly above black."""
FLOOR = np.float32(0.01)
"""What an uncertain but visible sample keeps: it yields to every better one, yet colors a point
that has no better one."""

DEPTH_JUMP_PX = 12.0
"""Depth steps between neighboring pixels larger than so many pixel footprints are silhouettes:
a plane seen at 85 degrees off its normal makes steps of 11."""

CLIPPED = 0.9
"""Linear light from which on a channel begins to be clipped: 243 of 255."""

DARK = (0.0015, 0.004)
"""Linear light of the brightest channel in which 8 bits have steps of 20 % (5 of 255), and of 8 %
(13 of 255)."""


def picture_factors(
    photo: Photo, small: NDArray[np.uint16], white: float, options: ColorOptions
) -> dict[str, Floats]:
    """Each factor's (h, w) float32 image by name, in a reduced picture of the photo.

    border: ramp from the picture's edge; mask: ramp from the stencil, 0 on it (only if there is
    one); exposure: falls where a channel is clipped, or where all are hardly above black.
    small: (h, w, 3) linear light, `white` = 1.
    """
    height, width = small.shape[:2]
    diagonal = float(np.hypot(width, height))
    factors = {"border": border_factor(height, width, BORDER_FEATHER * diagonal)}
    if photo.mask is not None and not photo.mask.all():
        erode, feather = options.mask_erode * diagonal, MASK_FEATHER * diagonal
        factors["mask"] = mask_factor(photo.mask, (height, width), erode, feather)
    if min(options.clipped_weight, DARK_WEIGHT) < 1:
        factors["exposure"] = exposure_factor(small, white, options.clipped_weight, DARK_WEIGHT)
    return factors


def border_factor(height: int, width: int, feather_px: float) -> Floats:
    """Smooth ramp from the picture's edge inwards."""
    x, y = np.arange(width) + 0.5, np.arange(height) + 0.5
    across = smooth_ramp(np.minimum(x, width - x), feather_px)
    down = smooth_ramp(np.minimum(y, height - y), feather_px)
    return np.minimum(across, down[:, None])


def mask_factor(
    mask: NDArray[np.uint8], shape: tuple[int, int], erode_px: float, feather_px: float
) -> Floats:
    """Ramp from the stencil's edge; 0 on the stencil itself and `erode_px` around it, at least one
    pixel.
    """
    size = (shape[1], shape[0])
    free = cv2.resize((mask > 0).astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA) == 255
    distance = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, 5) - max(erode_px, 1.0)
    return np.clip(distance / np.float32(max(feather_px, 1.0)), 0, 1).astype(np.float32)


def exposure_factor(small: NDArray[np.uint16], white: float, clipped: float, dark: float) -> Floats:
    """`clipped` where a channel is at white, `dark` where all are below the lower limit of `DARK`,
    1 from its upper limit to `CLIPPED`, ramps between.
    """
    red, green, blue = cv2.split(small)
    return _exposure_curve(white, clipped, dark).take(cv2.max(cv2.max(red, green), blue))


@lru_cache(4)
def _exposure_curve(white: float, clipped: float, dark: float) -> Floats:
    """(65536,) the factor of each value of the brightest channel."""
    light = np.arange(65536) / white
    over = np.clip((light - CLIPPED) / (0.99 - CLIPPED), 0, 1)
    under = np.clip((DARK[1] - light) / (DARK[1] - DARK[0]), 0, 1)
    factor = 1 - over * (1 - clipped) - under * (1 - min(dark, 1))
    return factor.astype(np.float32)


def silhouette_factor(depth: Floats, focal_px: float, feather_px: float) -> Floats:
    """Smooth ramp from the next depth discontinuity or border of the mesh.

    A discontinuity is a step of more than `DEPTH_JUMP_PX` pixel footprints (depth / focal).
    A feather of 0 switches the factor off.
    """
    if feather_px <= 0:
        return np.ones(depth.shape, np.float32)
    finite = np.minimum(depth, np.float32(1e30))
    kernel = np.ones((3, 3), np.uint8)
    near, far = cv2.erode(finite, kernel), cv2.dilate(finite, kernel)
    smooth = far - near <= near * np.float32(DEPTH_JUMP_PX / focal_px)
    if smooth.all():
        return np.ones(depth.shape, np.float32)
    distance = cv2.distanceTransform(smooth.astype(np.uint8), cv2.DIST_L2, 3)
    return smooth_ramp(distance - np.float32(1), feather_px)


def smooth_ramp(distance: NDArray[np.floating], length: float) -> Floats:
    """Smooth 0..1 over `length`, never under `FLOOR`."""
    t = np.multiply(distance, 1 / max(length, 1e-3), dtype=np.float32)
    np.clip(t, 0, 1, out=t)
    out = np.float32(3) - np.float32(2) * t
    out *= t
    out *= t
    return np.maximum(out, FLOOR, out=out)
