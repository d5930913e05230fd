"""Color of the stone as a function of position: true color is known at any surface point."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from texproj.arrays import Floats
from texproj.demo.noise import noise

Pattern = Callable[[Floats], Floats]
"""(n, 3) float32 points of the local frame, metres, to (n, 3) float32 linear albedo in 0..1."""

LIMESTONE = (0.60, 0.53, 0.43)
RED, BLUE = (0.42, 0.075, 0.04), (0.05, 0.14, 0.36)
GREEN, YELLOW = (0.10, 0.24, 0.11), (0.62, 0.40, 0.08)
LICHEN, SOOT = (0.36, 0.34, 0.16), (0.10, 0.09, 0.08)

BANDS = ((0.02, 0.10, RED), (0.13, 0.165, YELLOW), (0.19, 0.27, BLUE), (0.93, 0.985, RED),
         (1.0, 1.045, BLUE), (0.30, 0.33, GREEN), (0.83, 0.88, YELLOW))  # fmt: skip
"""Painted stripes: lowest and highest z in metres, color."""


def uniform(albedo: float = 0.5) -> Pattern:
    """Plain matte gray."""
    return partial(_constant, albedo=albedo)


def painted(seed: int = 0, paint: float = 1.0) -> Pattern:
    """Weathered limestone with the rests of paint: bands, chevrons, a blue niche, spiral
    stripes; veins, lichen, soot and grain down to a millimetre.

    paint: share of all that which is left over plain stone.
    """
    whole = partial(_painted, seed=seed)
    return whole if paint == 1 else partial(_faded, pattern=whole, paint=paint)


def _faded(xyz: Floats, pattern: Pattern, paint: float) -> Floats:
    stone = np.float32(1 - paint) * np.asarray(LIMESTONE, np.float32)
    return np.float32(paint) * pattern(xyz) + stone


def _constant(xyz: Floats, albedo: float) -> Floats:
    return np.full((len(xyz), 3), albedo, np.float32)


def _mix(color: Floats, other: tuple[float, float, float], share: Floats) -> Floats:
    """(3, n) channels moved towards `other` by (n,) shares."""
    return color + share * (np.asarray(other, np.float32)[:, None] - color)


def _rise(value: Floats, low: float, high: float) -> Floats:
    """0 below `low`, 1 above `high`, smooth between."""
    t = np.clip((value - np.float32(low)) * np.float32(1 / (high - low)), 0, 1)
    return t * t * (3 - 2 * t)


def _painted(xyz: Floats, seed: int) -> Floats:
    broad = noise(xyz, 1.7, seed + 21, 1.6)
    fine = noise(xyz, 0.11, seed + 22, 1.2)
    stone = np.asarray(LIMESTONE, np.float32)[:, None] * (1 + 0.10 * broad + 0.07 * fine)
    vein = np.abs(noise(xyz, 0.9, seed + 23, 2.4))
    stone = _mix(stone, SOOT, 0.75 * (1 - _rise(vein, 0.012, 0.035)))
    color = _paint(stone, xyz, 0.85 * _rise(broad + 0.35 * fine, -1.15, -0.8))
    color = _mix(color, LICHEN, 0.8 * _rise(broad + 0.45 * fine, 1.35, 1.7))
    return np.clip(color * (1 + 0.09 * fine), 0.01, 0.95).T


def _paint(color: Floats, xyz: Floats, kept: Floats) -> Floats:
    """Paint over the (3, n) stone where `kept` (n,) of the weather says so."""
    x, y, z = np.ascontiguousarray(xyz.T)
    around = np.arctan2(x, -y) * np.float32(0.45)
    for low, high, pigment in BANDS:
        inside = _rise(z, low, low + 0.002) * (1 - _rise(z, high, high + 0.002))
        color = _mix(color, pigment, inside * kept)
    recess = (np.abs(x) < 0.2) & (y > -0.08) & (y < 0.1)
    color = _mix(color, YELLOW, _chevrons(around, z) * kept)
    color = _mix(color, RED, _diamonds(around, z) * kept)
    color = _mix(color, BLUE, recess * kept)
    return _mix(color, GREEN, _stripes(x, y, z) * kept)


def _chevrons(around: Floats, z: Floats) -> Floats:
    fold = np.abs(((around / 0.06) % 1) - 0.5) * 0.05
    edge = np.abs(z - 0.215 - fold)
    return _rise(0.008 - edge, 0, 0.002)


def _diamonds(around: Floats, z: Floats) -> Floats:
    u = np.abs(((around / 0.09) % 1) - 0.5) * 0.09
    v = np.abs(z - 0.855)
    return _rise(0.028 - u - v, 0, 0.002)


def _stripes(x: Floats, y: Floats, z: Floats) -> Floats:
    """A spiral on whatever stands in the middle of the front, between base and arch."""
    turn = np.arctan2(x, y + 0.155) * np.float32(0.5 / np.pi) + z / 0.09
    stripe = _rise(np.abs((turn % 1) - 0.5), 0.30, 0.33)
    near = (np.hypot(x, y + 0.155) < 0.062) & (z > 0.31) & (z < 0.70)
    return stripe * near
