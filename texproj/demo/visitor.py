"""Somebody who walked into the picture."""

from __future__ import annotations

import cv2
import numpy as np

from texproj.arrays import Floats

COAT, SKIN, HAIR = (0.30, 0.05, 0.06), (0.50, 0.30, 0.20), (0.05, 0.03, 0.02)


def in_front(light: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """The (h, w, 3) picture with a person seen from behind, cut by its lower edge, and the
    (h, w) share of each pixel that the person hides.
    """
    h, w = light.shape[:2]
    x = w * (0.36 + 0.06 * rng.random())
    top = h * (0.42 + 0.04 * rng.random())
    tall = h - top
    parts = (
        (COAT, (x, top + 0.30 * tall + 0.55 * tall), (0.27 * tall, 0.58 * tall), 4.0),
        (COAT, (x, top + 0.75 * tall), (0.16 * tall, 0.50 * tall), 2.0),
        (SKIN, (x, top + 0.24 * tall), (0.06 * tall, 0.10 * tall), 2.0),
        (HAIR, (x, top + 0.13 * tall), (0.095 * tall, 0.13 * tall), 2.0),
    )
    hidden = np.zeros((h, w), np.float32)
    cloth = _cloth(h, w, rng)
    for color, center, half, square in parts:
        share, shade = _body(h, w, center, half, square)
        painted = np.asarray(color, np.float32) * (shade * cloth)[..., None]
        light = (light + share[..., None] * (painted - light)).astype(np.float32)
        hidden = np.maximum(hidden, share)
    return light, hidden


def _body(
    h: int, w: int, center: tuple[float, float], half: tuple[float, float], square: float
) -> tuple[Floats, Floats]:
    """Coverage with a soft edge, and round shading, of an upright superellipse: 2 is an ellipse,
    larger exponents have shoulders.
    """
    y, x = np.mgrid[:h, :w].astype(np.float32) + 0.5
    u, v = (x - center[0]) / half[0], (y - center[1]) / half[1]
    radius = (np.abs(u) ** square + np.abs(v) ** square) ** np.float32(1 / square)
    share = np.clip((1 - radius) * half[0] / 2.5 + 0.5, 0, 1)
    round_shade = np.sqrt(np.maximum(1 - radius**2, 0)) * np.clip(0.75 - 0.5 * u, 0, 1)
    return share.astype(np.float32), (0.35 + 0.65 * round_shade).astype(np.float32)


def _cloth(h: int, w: int, rng: np.random.Generator) -> Floats:
    """(h, w) folds and weave around 1."""
    folds = cv2.resize(rng.standard_normal((h // 40 + 2, w // 12 + 2), np.float32), (w, h),
                       interpolation=cv2.INTER_CUBIC)  # fmt: skip
    weave = rng.standard_normal((h, w), np.float32)
    return np.clip(1 + 0.14 * folds + 0.03 * weave, 0.3, 2).astype(np.float32)
