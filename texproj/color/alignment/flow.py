"""Dense displacement between two pictures of the same thing, where it is sure."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats

CONTRAST_PX = 8.0
"""Deviation of the neighborhood over which brightness and contrast are made equal."""

TEXTURED = 0.012
"""Deviation of the light (0..1, sRGB) in a neighborhood above which there is something to hold on
to: three steps of 8 bits."""

ROUND_TRIP_PX = 0.5
"""Distance by which the way there and back may miss."""

ALIKE = 0.7
"""Correlation of neighborhoods, after the displacement."""

SMOOTH_PX = 12.0
"""Deviation of the neighborhood over which displacements are averaged: what is smaller is not the
camera's doing."""

OUTLIER_PX = 1.0
"""Distance to the average of the neighborhood from which on a displacement is dropped."""

DOUBT = 0.35
"""Part of a neighborhood that has to be sure for about half of its displacement to be believed."""


def sure_flow(
    here: Floats, there: Floats, solid: NDArray[np.bool_], largest_px: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """(h, w, 2) smooth displacement: there[q] is seen at here[q + shift[q]]; and where it is sure.

    here, there: (h, w) float32 light 0..1; solid: pixels of `there` that count. Sure is what comes
    back where it went, has texture in both pictures, looks alike afterwards, is not longer than
    `largest_px` and like its neighborhood; away from that the displacement fades to 0.
    """
    a, b = evened(there), evened(here)
    way, back = flow(a, b), flow(b, a)
    came = warped(back, way)
    sure = cv2.erode(solid.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    sure &= np.hypot(*np.moveaxis(way + came, -1, 0)) < ROUND_TRIP_PX
    sure &= np.hypot(*np.moveaxis(way, -1, 0)) < largest_px
    moved = warped(here, way)
    sure &= (_deviation(there) > TEXTURED) & (_deviation(moved) > TEXTURED)
    sure &= correlation(a, warped(b, way)) > ALIKE
    mean, _ = _averaged(way, sure)
    sure &= np.hypot(*np.moveaxis(way - mean, -1, 0)) < OUTLIER_PX
    mean, near = _averaged(way, sure)
    believed = (1 + DOUBT**2) * near * near / (near * near + np.float32(DOUBT**2))
    return mean * believed[..., None], sure


def flow(a: Floats, b: Floats) -> Floats:
    """(h, w, 2) dense inverse search (Kroeger et al. 2016): a[q] is seen at b[q + flow[q]]."""
    finder = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    finder.setFinestScale(1)
    return finder.calc(_as_bytes(a), _as_bytes(b), None)


def warped(image: Floats, shift: Floats) -> Floats:
    """The image displaced: at each pixel q its value at q + shift[q], (h, w, 2) pixels."""
    height, width = shift.shape[:2]
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    maps = np.dstack([x, y]) + shift
    return cv2.remap(image, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def evened(light: Floats) -> Floats:
    """Light less its average around, over its deviation there."""
    apart = light - _blurred(light, CONTRAST_PX)
    return apart / np.sqrt(_blurred(apart * apart, CONTRAST_PX) + np.float32(TEXTURED**2))


def correlation(a: Floats, b: Floats) -> Floats:
    """Correlation of neighborhoods of evened pictures."""
    power = _blurred(a * a, CONTRAST_PX / 2) * _blurred(b * b, CONTRAST_PX / 2)
    return _blurred(a * b, CONTRAST_PX / 2) / np.sqrt(power + np.float32(1e-6))


def _averaged(shift: Floats, sure: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Mean displacement of what is sure around, and how much of it there is."""
    weight = sure.astype(np.float32)
    near = _blurred(weight, SMOOTH_PX)
    total = _blurred(shift * weight[..., None], SMOOTH_PX)
    mean: Floats = total / (near + np.float32(1e-6))[..., None]
    return mean, near


def _deviation(light: Floats) -> Floats:
    mean = _blurred(light, CONTRAST_PX / 2)
    return np.sqrt(np.maximum(_blurred(light * light, CONTRAST_PX / 2) - mean * mean, 0))


def _blurred(image: Floats, deviation: float) -> Floats:
    return cv2.GaussianBlur(image, (0, 0), deviation)


def _as_bytes(light: Floats) -> NDArray[np.uint8]:
    return np.clip(light * np.float32(40) + 128, 0, 255).astype(np.uint8)
