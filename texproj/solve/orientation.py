"""Orientation fields: where an image has edges and which way they run, free of their sign and
strength, so that a photograph and a rendering of bare geometry can be compared.

An edge that runs at angle a gives the complex number exp(2ia): doubling makes opposite
gradients equal. This is the part of the "orientation channels modulo 180 degrees" of CFOG
(Ye et al., "Fast and Robust Matching for Multimodal Remote Sensing Image Registration", IEEE
TGRS 2019) that carries their information: eight channels |g . d| with their mean removed are
its real and imaginary part, rotated, up to a fifth harmonic of 4 % energy.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats

Field = NDArray[np.complex64]

PRE_BLUR_PX = 0.8
"""Smoothing before the gradients: below the pixel noise of a photo reduced by areas."""
POOL_BLUR_PX = 1.5
"""Pooling of orientations: what two images of one edge may differ by and still agree."""
DARK = 0.03
"""Gray level added before the logarithm: the noise floor of 8-bit shadows."""


def photo_field(gray: Floats, valid: NDArray[np.bool_] | None = None) -> Field:
    """(h, w) luma in 0..1 to its (h, w) complex64 orientation field; 0 where not `valid`.

    Gradients of the logarithm, so that a shaded wall counts like a sunlit one.
    """
    return _pooled([np.log(gray + np.float32(DARK))], valid)


def render_field(channels: Sequence[Floats], valid: NDArray[np.bool_]) -> Field:
    """Orientation field of several (h, w) channels of one rendering, their edges added up.

    `valid`: where the mesh is, without its rim; 0 elsewhere.
    """
    return _pooled(channels, valid)


def _pooled(channels: Sequence[Floats], valid: NDArray[np.bool_] | None) -> Field:
    shape = channels[0].shape
    doubled, strength = np.zeros(shape, np.complex64), np.zeros(shape, np.float32)
    for channel in channels:
        gradient = _gradient(channel)
        magnitude = np.abs(gradient)
        doubled += gradient * gradient / np.maximum(magnitude, 1e-12)
        strength += magnitude
    if valid is not None:
        doubled[~valid], strength[~valid] = 0, 0
    pooled = _blur(doubled.view(np.float32).reshape(*shape, 2), POOL_BLUR_PX)
    total = _blur(strength, POOL_BLUR_PX)
    inside = strength[valid] if valid is not None else strength
    floor = 0.5 * float(inside.mean()) if inside.size else 1.0
    field: Field = np.ascontiguousarray(pooled).view(np.complex64)[..., 0] / (total + floor + 1e-9)
    if valid is not None:
        field[~valid] = 0
    return field


def _gradient(image: Floats) -> Field:
    smooth = _blur(image, PRE_BLUR_PX)
    out = np.empty(image.shape, np.complex64)
    out.real = cv2.Scharr(smooth, cv2.CV_32F, 1, 0, scale=1 / 32)
    out.imag = cv2.Scharr(smooth, cv2.CV_32F, 0, 1, scale=1 / 32)
    return out


def _blur(image: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    return cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)
