"""What is behind the stone: a gravel court with trees, a gradient, or a uniform wall."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Floats
from texproj.demo.caster import Caster
from texproj.demo.light import Lighting
from texproj.demo.noise import noise

Color = tuple[float, float, float]

WALL = (0.42, 0.43, 0.45)
HORIZON, ZENITH = (0.80, 0.86, 0.93), (0.28, 0.45, 0.78)
LEAVES_DARK, LEAVES_LIGHT = (0.025, 0.045, 0.015), (0.16, 0.22, 0.06)
LEAVES = (0.08, 0.12, 0.035)
GRAVEL = (0.36, 0.32, 0.26)
HAZE_METRES = 14.0


def wall(directions: Floats) -> Floats:
    """(n, 3) the same gray everywhere."""
    return np.broadcast_to(np.asarray(WALL, np.float32), directions.shape).copy()


def gradient(directions: Floats) -> Floats:
    """(n, 3) dark below, light above, slightly blotchy."""
    height = directions[:, 2:] * 0.6 + 0.5
    blotch = noise(directions, 2.5, 61, 2.6)[:, None]
    return np.clip(np.asarray(WALL, np.float32) * (0.4 + height + 0.06 * blotch), 0, 1)


def garden(
    directions: Floats, center: Floats, caster: Caster, lighting: Lighting, seed: int
) -> Floats:
    """(n, 3) gravel, with the stone's shadow on it, that fades into a row of trees under the sky.

    center: (3,) where the rays start.
    """
    falling = (directions[:, 2] < -1e-3) & (center[2] > 0)
    far = center[2] / np.maximum(-directions[:, 2], 1e-3)
    haze = np.where(falling, 1 - np.exp(far / -HAZE_METRES), 1).astype(np.float32)[:, None]
    light = np.asarray(LEAVES, np.float32) * haze
    distant = np.flatnonzero(haze > 0.3)
    light[distant] = _trees(directions[distant], seed) * haze[distant]
    down = np.flatnonzero(falling)
    ground = center + directions[down] * far[down, None]
    ground[:, 2] = 0
    light[down] += _gravel(caster, ground, lighting) * (1 - haze[down])
    return light


def _trees(directions: Floats, seed: int) -> Floats:
    """(n, 3) sky over trees, out of focus."""
    height = directions[:, 2]
    t = np.clip(height * 1.6, 0, 1)[:, None]
    sky = _between(HORIZON, ZENITH, t)
    bearing = directions * np.array((1, 1, 0), np.float32)
    crown = 0.16 + 0.05 * noise(bearing, 3.0, seed + 62, 1.7)
    share = np.clip((crown - height) / 0.02 + 0.5, 0, 1)[:, None]
    light = np.clip(0.45 + 0.3 * noise(directions, 1.1, seed + 63, 1.4), 0, 1)[:, None]
    return sky + share * (_between(LEAVES_DARK, LEAVES_LIGHT, light) - sky)


def _between(low: Color, high: Color, share: Floats) -> Floats:
    a, b = np.asarray(low, np.float32), np.asarray(high, np.float32)
    return a + share * (b - a)


def _gravel(caster: Caster, xyz: Floats, lighting: Lighting) -> Floats:
    """(n, 3) light from points of the ground z = 0."""
    blocked = caster.blocked(xyz, np.broadcast_to(lighting.to_sun, xyz.shape))
    low, high = caster.vertices.min(0), caster.vertices.max(0)
    dx, dy = (np.maximum(np.maximum(low[k] - xyz[:, k], xyz[:, k] - high[k]), 0) for k in range(2))
    # The sky that a wall of the stone's size leaves at its foot: half, all of it far away.
    open_sky = 1 - 0.55 * np.exp(np.hypot(dx, dy) / np.float32(-0.28))
    light = open_sky[:, None] * np.asarray(lighting.sky, np.float32)
    sun = np.where(blocked, 0, lighting.to_sun[2]).astype(np.float32)
    light += sun[:, None] * np.asarray(lighting.sun, np.float32)
    grain = 0.16 * noise(xyz, 0.23, 64, 1.0) + 0.10 * noise(xyz, 2.9, 65, 1.4)
    return light * np.maximum(1 + grain, 0.2)[:, None] * np.asarray(GRAVEL, np.float32)
