"""Which direction each pixel looks in, and how light falls off towards the corners."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from scipy.interpolate import RectBivariateSpline

from texproj.arrays import Floats
from texproj.camera import Intrinsics

NODE_STEP = 12.0
"""Pixels between the nodes where the lens model is inverted; between them bicubic splines,
which stay within 1e-5 px for distortions of photographic lenses."""


KEPT_PIXELS = 1_000_000
"""Largest photo whose directions are kept for the next photo with that lens, 12 bytes a pixel."""


def directions(k: Intrinsics, dx: float = 0.5, dy: float = 0.5) -> Floats:
    """(h, w, 3) unit directions in cam axes, through the point (dx, dy) of every pixel.

    The lens model is inverted by OpenCV's own iteration, not by texproj's.
    """
    small = k.width * k.height <= KEPT_PIXELS
    return _kept(k, dx, dy) if small else _worked_out(k, dx, dy)


@lru_cache(maxsize=16)
def _kept(k: Intrinsics, dx: float, dy: float) -> Floats:
    return _worked_out(k, dx, dy)


def _worked_out(k: Intrinsics, dx: float, dy: float) -> Floats:
    u = np.linspace(-1, k.width + 1, int(np.ceil(k.width / NODE_STEP)) + 4)
    v = np.linspace(-1, k.height + 1, int(np.ceil(k.height / NODE_STEP)) + 4)
    nodes = np.stack(np.meshgrid(u, v), -1).reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-13)
    ideal = cv2.undistortPoints(nodes, k.K, np.array(k.dist), criteria=stop)
    ideal = ideal.reshape(len(v), len(u), 2)
    at_v, at_u = np.arange(k.height) + dy, np.arange(k.width) + dx
    xy = [RectBivariateSpline(v, u, ideal[..., c])(at_v, at_u) for c in range(2)]
    rays = np.stack([*xy, np.ones_like(xy[0])], -1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    out: Floats = rays.astype(np.float32)
    out.flags.writeable = False
    return out


def vignetting(k: Intrinsics, loss: float) -> Floats:
    """(h, w) factor: 1 at the principal point, 1 - loss at half a diagonal from it.

    Falls like the fourth power of a cosine: (1 + a r^2)^-2.
    """
    x = np.arange(k.width) + 0.5 - k.cx
    y = np.arange(k.height) + 0.5 - k.cy
    squared = (x**2 + y[:, None] ** 2) / ((k.width**2 + k.height**2) / 4)
    a = (1 - loss) ** -0.5 - 1
    return ((1 + a * squared) ** -2).astype(np.float32)
