"""A capital: a piece of fluted shaft, two rows of leaves that curl outwards, corner volutes and
a slab with hollow sides on top.
"""

from __future__ import annotations

import numpy as np

from texproj.arrays import Floats
from texproj.demo.shapes import Field, box, carve, join, sphere, turned


def solid(seed: int) -> tuple[Field, tuple[float, float, float]]:
    """The capital's distance field and the half sizes (x, y) and height of a box around it."""
    rng = np.random.default_rng([seed, 2])
    leaves, flutes = int(rng.integers(6, 10)), int(rng.integers(14, 22))
    curl = float(rng.uniform(0.055, 0.075))
    chips = rng.uniform((-0.45, -0.45, 0.6), (0.45, 0.45, 0.9), (5, 3))

    def field(xyz: Floats) -> Floats:
        x, y, z = xyz.T
        r, angle = np.hypot(x, y), np.arctan2(y, x)
        stone = join(_shaft(r, angle, z, flutes), _bell(r, z))
        lower = _leaf(r, _sector(angle, leaves, 0.0), z, 0.30, 0.22, curl)
        upper = _leaf(r, _sector(angle, leaves, 0.5), z, 0.42, 0.24, curl * 1.2)
        stone = join(stone, join(lower, upper), 0.006)
        stone = join(stone, join(_slab(xyz), _volutes(xyz)), 0.01)
        for chip in chips:
            stone = carve(stone, sphere(xyz, chip, 0.07), 0.01)
        return stone

    return field, (0.56, 0.56, 0.92)


def _sector(angle: Floats, count: int, phase: float) -> Floats:
    """Angle from the middle of the nearest of `count` leaves."""
    turn = angle * np.float32(count / (2 * np.pi)) + np.float32(phase)
    return ((turn - np.round(turn)) * np.float32(2 * np.pi / count)).astype(np.float32)


def _shaft(r: Floats, angle: Floats, z: Floats, flutes: int) -> Floats:
    groove = 0.018 * np.abs(np.sin(angle * flutes / 2)) * ((z > 0.09) & (z < 0.2))
    profile = [
        (0.0, 0.33),
        (0.06, 0.33),
        (0.09, 0.28),
        (0.2, 0.262),
        (0.22, 0.3),
        (0.25, 0.3),
        (0.27, 0.25),
    ]
    return turned(r - (groove - 0.009).astype(np.float32), z, profile)


def _bell(r: Floats, z: Floats) -> Floats:
    return turned(r, z, [(0.2, 0.23), (0.5, 0.23), (0.68, 0.3), (0.74, 0.36), (0.76, 0.3)])


def _leaf(r: Floats, sector: Floats, z: Floats, foot: float, tall: float, curl: float) -> Floats:
    """A leaf: a bent sheet that leaves the bell, overhangs and has a rib and lobed edges."""
    up = np.clip((z - foot + 0.06) / tall, 0, 1.25)
    across = sector * r
    lobes = 0.012 * np.sin(up * 32)
    half_width = 0.095 * np.sqrt(np.clip(1.12 - up, 0, 1)) + lobes
    rib = 0.016 * np.cos(np.clip(across / 0.012, -np.pi, np.pi)) - 0.25 * np.abs(across)
    out = 0.225 + 0.03 * up + curl * 2.2 * up**4 + rib
    sheet = np.abs(r - out) - 0.018
    ends = np.maximum(foot - 0.06 - z, z - foot + 0.06 - tall * 1.06)
    body = np.maximum(np.maximum(sheet, np.abs(across) - half_width) * 0.6, ends)
    tip = np.hypot(r - 0.255 - curl * 2.2, z - foot + 0.06 - tall) - 0.026
    tip = np.maximum(tip, np.abs(across) - 0.05)
    return join(body.astype(np.float32), tip.astype(np.float32), 0.02)


def _slab(xyz: Floats) -> Floats:
    slab = box(xyz, (0, 0, 0.795), (0.42, 0.42, 0.05), 0.008)
    groove = box(xyz, (0, 0, 0.79), (0.5, 0.5, 0.006))
    for x, y in ((1.32, 0), (-1.32, 0), (0, 1.32), (0, -1.32)):
        slab = carve(slab, (np.hypot(xyz[:, 0] - x, xyz[:, 1] - y) - 0.98).astype(np.float32), 0.01)
    inner = box(xyz, (0, 0, 0.79), (0.3, 0.3, 0.02))
    return carve(slab, carve(groove, inner - 0.06), 0.003)


def _volutes(xyz: Floats) -> Floats:
    """Scrolls under the slab's four corners."""
    x, y, z = np.abs(xyz[:, 0]), np.abs(xyz[:, 1]), xyz[:, 2]
    along, across = (x + y) / np.sqrt(2) - 0.47, (x - y) / np.sqrt(2)
    radius, angle = np.hypot(along, z - 0.69), np.arctan2(z - 0.69, along)
    turn = radius / 0.026 - angle / (2 * np.pi)
    groove = 0.007 * np.cos(2 * np.pi * turn)
    disk = np.maximum(radius - 0.075, np.abs(across) - 0.045 - groove)
    stem = np.maximum(
        np.abs(np.hypot(along + 0.14, z - 0.56) - 0.15) - 0.022, np.abs(across) - 0.04
    )
    stem = np.maximum(stem, np.maximum(-along - 0.14, 0.52 - z))
    return join((disk * 0.8).astype(np.float32), (stem * 0.8).astype(np.float32), 0.01)
