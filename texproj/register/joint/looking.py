"""Where a camera sees many points, and what pictures show there: in float32, x and y apart.

A hundred million points are asked for in a refinement; the places are good to a thousandth of a
pixel, of which `cv2.remap` uses a thirtieth.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bools, Floats
from texproj.camera import Intrinsics
from texproj.opencv import FAR_OUTSIDE


def pixels_of(k: Intrinsics, xyz_in_cam: Floats) -> Floats:
    """(2, ...) float32 x and y at which points (3, ...) in camera axes are in the picture, from the
    center of its first pixel as OpenCV counts; far outside where they are not seen.

    Points are overwritten, and the places lie in their memory.
    """
    at, z = xyz_in_cam[:2], xyz_in_cam[2]
    behind = z <= 0
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        at /= z
        unseen = behind | ~_bent(k, *at)
        for axis, (focal, middle) in enumerate(((k.fx, k.cx), (k.fy, k.cy))):
            at[axis] *= np.float32(focal)
            at[axis] += np.float32(middle - 0.5)
    if unseen.any():
        at[:, unseen] = FAR_OUTSIDE
    return at


def _bent(k: Intrinsics, x: Floats, y: Floats) -> Bools:
    """Distorts ideal coordinates x, y in their place; (...) where that is defined."""
    r2 = x * x
    r2 += y * y
    known = r2 < k.max_radius**2
    if not k.distorted:
        return known
    if k.is_fisheye or any(k.dist[2:4]) or any(k.dist[5:]):
        for own, bent in zip((x, y), k.distort_each(x.ravel(), y.ravel()), strict=True):
            own[...] = bent.reshape(x.shape)
        return known
    k1, k2, _, _, k3 = (*k.dist, 0.0)[:5]
    radial = r2 * np.float32(k3 or k2)
    for factor in (k2, k1) if k3 else (k1,):
        radial += np.float32(factor)
        radial *= r2
    radial += np.float32(1)
    x *= radial
    y *= radial
    return known


def looked_up(image: NDArray[Any], at: Floats, interpolation: int, border: int) -> NDArray[Any]:
    """(...) values of an image (h, w) at places (2, ...)."""
    x, y = at.reshape(2, at.shape[1], -1)
    out = cv2.remap(image, x, y, interpolation, borderMode=border, borderValue=0)
    return out.reshape(at.shape[1:])
