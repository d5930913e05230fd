"""What is behind the stone: a gravel court with trees, a gradient, or a uniform wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.demo.caster import Caster
from texproj.demo.light import Lighting
from texproj.demo.noise import noise

Floats = NDArray[np.float32]

WALL = (0.42, 0.43, 0.45)
HORIZON, ZENITH = (0.80, 0.86, 0.93), (0.28, 0.45, 0.78)
LEAVES_DARK, LEAVES_LIGHT = (0.025, 0.045, 0.015), (0.16, 0.22, 0.06)
GRAVEL = (0.36, 0.32, 0.26)
HAZE_METRES = 14.0


def wall(directions: Floats, seed: int) -> Floats:
    """(n, 3) the same gray everywhere."""
    return np.broadcast_to(np.asarray(WALL, np.float32), directions.shape).copy()


def gradient(directions: Floats, seed: int) -> Floats:
    """(n, 3) dark below, light above, slightly blotchy."""
    height = directions[:, 2:] * 0.6 + 0.5
    blotch = noise(directions, 2.5, seed + 61, 2.6)[:, None]
    return np.clip(np.asarray(WALL, np.float32) * (0.4 + height + 0.06 * blotch), 0, 1)


def garden(directions: Floats, seed: int) -> Floats:
    """(n, 3) sky over a row of trees, out of focus."""
    height = directions[:, 2]
    t = np.clip(height * 1.6, 0, 1)[:, None]
    sky = np.asarray(HORIZON, np.float32) * (1 - t) + t * np.asarray(ZENITH, np.float32)
    bearing = directions * (1.0, 1.0, 0.0)
    crown = 0.16 + 0.05 * noise(bearing, 3.0, seed + 62, 1.7)
    share = np.clip((crown - height) / 0.02 + 0.5, 0, 1)[:, None]
    light = np.clip(0.45 + 0.3 * noise(directions, 1.1, seed + 63, 1.4), 0, 1)[:, None]
    dark = np.asarray(LEAVES_DARK, np.float32)
    trees = dark + light * (np.asarray(LEAVES_LIGHT, np.float32) - dark)
    return (sky + share * (trees - sky)).astype(np.float32)


def court(caster: Caster, xyz: Floats, lighting: Lighting, seed: int) -> Floats:
    """(n, 3) light from points of the gravel ground z = 0, with the stone's shadow on it."""
    blocked = caster.blocked(xyz, np.broadcast_to(lighting.to_sun, xyz.shape))
    low, high = caster.vertices.min(0)[:2], caster.vertices.max(0)[:2]
    gap = np.maximum(np.maximum(low - xyz[:, :2], xyz[:, :2] - high), 0)
    # The sky that a wall of the stone's size leaves at its foot: half, all of it far away.
    open_sky = 1 - 0.55 * np.exp(-np.sqrt((gap**2).sum(1, keepdims=True)) / 0.28)
    light = np.asarray(lighting.sky, np.float32) * open_sky
    light += np.where(blocked, 0, lighting.to_sun[2])[:, None] * np.asarray(lighting.sun)
    grain = 0.16 * noise(xyz, 0.23, seed + 64, 1.0) + 0.10 * noise(xyz, 2.9, seed + 65, 1.4)
    return (np.asarray(GRAVEL) * light * np.maximum(1 + grain, 0.2)[:, None]).astype(np.float32)
