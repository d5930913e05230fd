"""Whether a photo's mask fits the mesh as it is, or only turned like the photo."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from texproj.arrays import Bytes, Mask
from texproj.camera import Camera
from texproj.register.proof.alone import GLANCE_PX
from texproj.render import Render

OUTLINE, CLEARLY = 0.75, 0.08
"""Intersection over union with the mesh's view from which on a turned mask is the object's outline,
and by how much more than as it is: masks that hide a passer-by are no outlines either way."""


def fits_turned(
    mask: Bytes, camera: Camera, render: Render, turn: Callable[[Bytes], Bytes]
) -> bool:
    """Whether the mask (any size, 0 = not the object) fits what `camera` sees of the mesh clearly
    better after `turn`.
    """
    depth = render(camera.scaled(GLANCE_PX / max(camera.width, camera.height))).depth
    if depth is None or not np.isfinite(depth).any():
        return False
    solid = np.isfinite(depth)
    return _overlap(turn(mask), solid) > max(OUTLINE, _overlap(mask, solid) + CLEARLY)


def _overlap(mask: Bytes, solid: Mask) -> float:
    """Intersection over union."""
    size = (solid.shape[1], solid.shape[0])
    kept = cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST) > 0
    return float((kept & solid).sum() / max((kept | solid).sum(), 1))
