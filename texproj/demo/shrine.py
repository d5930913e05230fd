"""A wayside shrine: a figure in an arched niche between a whole and a broken column, under a roof
of tiles; a jug on the step before it, a drum of the broken column beside it. No two of its sides
are alike, and what is carved stands far out: the photos show much of its shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Floats
from texproj.demo import ornament
from texproj.demo.shapes import Field, box, capsule, carve, extruded, join, sphere, turned


@dataclass(frozen=True)
class _Plan:
    """Measures in metres that the seed varies. broken: height of the right column's stump;
    folds: of the robe; tiles: their width; damage: (x, y, z, radius) of chips.
    """

    half_width: float
    half_depth: float
    arch: float
    broken: float
    folds: int
    tiles: float
    damage: tuple[tuple[float, ...], ...]


FLOOR = 0.14
"""Top of the plinth."""
EAVES = 0.97
SPRING = 0.66
"""Height where the niche's arch begins."""
SILL = 0.25
"""Height of the niche's floor."""
TOP = 1.30
"""Height of the ridge."""


def _plan(seed: int) -> _Plan:
    rng = np.random.default_rng([seed, 3])
    width, depth = rng.uniform(0.32, 0.36), rng.uniform(0.22, 0.25)
    corners = rng.choice([-1.0, 1.0], (8, 2)) * (width + 0.10, depth + 0.14)
    heights = rng.choice([0.05, 0.12, 0.5, 0.93, 1.0], 8)
    sizes = rng.uniform(0.04, 0.10, 8)
    damage = tuple(
        (*map(float, c), float(h), float(s))
        for c, h, s in zip(corners, heights, sizes, strict=True)
    )
    return _Plan(
        width, depth, rng.uniform(0.17, 0.19), rng.uniform(0.36, 0.50),
        int(rng.integers(7, 11)), rng.uniform(0.062, 0.075), damage,
    )  # fmt: skip


def solid(seed: int) -> tuple[Field, tuple[float, float, float]]:
    """The shrine's distance field and the half sizes (x, y) and height of a box around it."""
    plan = _plan(seed)
    side, back = _side(plan), _back(plan, seed)

    def field(xyz: Floats) -> Floats:
        stone = join(_mass(xyz, plan) - _faces(xyz, plan, side, back), _roof(xyz, plan))
        stone = carve(stone, _niche(xyz, plan), 0.006)
        stone = carve(stone, _window(xyz, plan), 0.006)
        stone = join(stone, _archivolt(xyz, plan), 0.004)
        stone = join(stone, _columns(xyz, plan), 0.006)
        stone = join(stone, _figure(xyz, plan), 0.008)
        stone = join(stone, _offerings(xyz, plan), 0.008)
        return _damaged(stone, xyz, plan)

    return field, (plan.half_width + 0.20, plan.half_depth + 0.30, TOP + 0.19)


def _mass(xyz: Floats, plan: _Plan) -> Floats:
    w, d = plan.half_width, plan.half_depth
    body = box(xyz, (0, 0, (FLOOR + EAVES) / 2), (w, d, (EAVES - FLOOR) / 2), 0.008)
    plinth = box(xyz, (0, -0.04, 0.05), (w + 0.13, d + 0.14, 0.05), 0.012)
    upper = box(xyz, (0, -0.04, 0.115), (w + 0.07, d + 0.10, 0.027), 0.01)
    step = box(xyz, (0.10, -d - 0.21, 0.028), (0.23, 0.07, 0.03), 0.01)
    buttress = box(xyz, (-w - 0.035, 0.06, 0.42), (0.05, 0.07, 0.30), 0.012)
    return join(join(join(body, upper, 0.01), join(plinth, step, 0.006), 0.006), buttress, 0.01)


def _roof(xyz: Floats, plan: _Plan) -> Floats:
    """A gable with rows of half-round tiles, a thick edge, and knobs of unlike size."""
    x, y, z = xyz.T
    half, rise = plan.half_width + 0.10, TOP - EAVES
    slope = np.float32(np.hypot(half, rise))
    across = y / plan.tiles
    tile = 0.017 * np.sqrt(np.maximum(1 - (2 * (across - np.round(across))) ** 2, 0))
    course = 0.009 * ((np.abs(x) / 0.105) % 1)
    above = (np.abs(x) * rise + (z - TOP) * half) / slope
    triangle = np.maximum(above, np.float32(EAVES - 0.01) - z)
    tiled = np.maximum(above - tile.astype(np.float32) - course, np.float32(EAVES + 0.02) - z)
    length = plan.half_depth + 0.09
    whole = join(extruded(triangle, y + 0.03, length), extruded(tiled, y + 0.01, length - 0.05))
    beyond = np.abs(y + 0.03) - np.float32(length)
    whole = carve(whole, extruded(triangle + np.float32(0.05), beyond, 0.045), 0.004)
    ridge = capsule(xyz, (0, -length + 0.02, TOP), (0, length - 0.12, TOP), 0.032)
    finial = turned(
        np.hypot(x, y + length), z,
        [(TOP - 0.04, 0.05), (TOP + 0.01, 0.055), (TOP + 0.025, 0.03), (TOP + 0.045, 0.06),
         (TOP + 0.075, 0.062), (TOP + 0.15, 0.012), (TOP + 0.16, 0.008)],
    )  # fmt: skip
    curl = np.hypot(np.hypot(x + half - 0.02, z - EAVES - 0.075) - 0.042, y + length - 0.015)
    horn = join(
        (curl - np.float32(0.024)).astype(np.float32),
        sphere(xyz, (0.02 - half, -length + 0.015, EAVES + 0.075), 0.024),
    )
    shield = turned(
        np.hypot(x - 0.01, z - 1.105), -y, [(0, 0.085), (length, 0.08), (length + 0.05, 0.03)]
    )
    return join(join(join(whole, ridge, 0.01), join(finial, horn), 0.012), shield, 0.004)


def _arch(x: Floats, z: Floats, plan: _Plan) -> Floats:
    """Distance of a wall's points from the outline of the niche, negative inside of it."""
    rounded = np.hypot(x, np.maximum(z - SPRING, 0)) - np.float32(plan.arch)
    return np.maximum(rounded, SILL - z)


def _niche(xyz: Floats, plan: _Plan) -> Floats:
    x, y, z = xyz.T
    return extruded(_arch(x, z, plan), y + plan.half_depth, plan.half_depth + 0.06)


def _window(xyz: Floats, plan: _Plan) -> Floats:
    """A pointed hollow in the right side."""
    x, y, z = xyz.T
    pointed = np.abs(y + 0.03) + np.maximum(z - 0.72, 0) * 0.7 - 0.085
    outline = np.maximum(pointed, np.float32(0.46) - z).astype(np.float32)
    return extruded(outline, x - plan.half_width, 0.085)


def _archivolt(xyz: Floats, plan: _Plan) -> Floats:
    """Wedge-shaped stones around the niche, every other one higher."""
    x, y, z = xyz.T
    ring = np.maximum(np.abs(_arch(x, z, plan) - 0.028) - 0.026, SILL - z)
    angle = np.arctan2(x, np.maximum(z - SPRING, 1e-3))
    high = np.sin(angle * 7 + 0.6) > 0
    low = np.where(high & (z > SPRING), 0.035, 0.016).astype(np.float32)
    return np.maximum(ring, np.abs(y + plan.half_depth) - low).astype(np.float32)


def _columns(xyz: Floats, plan: _Plan) -> Floats:
    """The left one whole, the right one broken off."""
    out, away = plan.half_depth + 0.035, plan.half_width - 0.055
    x, y, z = xyz.T
    left = _column(x + away, y + out, z, 9.0, EAVES)
    right = _column(x - away, y + out, z, -9.0, EAVES)
    cut = z - np.float32(plan.broken) + 0.5 * (x - away) - 0.25 * (y + out)
    return join(left, np.maximum(right, cut * np.float32(0.85)).astype(np.float32))


def _column(x: Floats, y: Floats, z: Floats, twist: float, top: float) -> Floats:
    """A twisted shaft with base and capital; it reaches into the stone at both ends."""
    angle, radius = np.arctan2(y, x), 0.046
    shaft = (z > 0.24) & (z < top - 0.12)
    flutes = np.where(shaft, np.abs(np.sin((angle * 6 + twist * z * 3.2) / 2)), 0.5)
    profile = [
        (0.10, 1.5), (0.165, 1.5), (0.175, 1.3), (0.195, 1.45), (0.215, 1.15), (0.23, 1.0),
        (top - 0.14, 0.85), (top - 0.12, 1.15), (top - 0.105, 0.95), (top - 0.03, 1.75),
        (top, 1.8), (top + 0.03, 1.6),
    ]  # fmt: skip
    scaled = [(height, r * radius) for height, r in profile]
    return turned(np.hypot(x, y) - (0.45 * radius * (flutes - 0.5)).astype(np.float32), z, scaled)


def _figure(xyz: Floats, plan: _Plan) -> Floats:
    """Somebody in a robe, turned a little, one arm raised, the other holding a bowl."""
    x, y, z = xyz.T
    ahead = np.float32(plan.half_depth - 0.085)
    u, v = x + 0.025 - 0.05 * (z - 0.5), y + ahead
    angle = np.arctan2(u, -v)
    folds = 0.011 * np.abs(np.sin(angle * plan.folds / 2 + 2.5 * z)) * (z < 0.52)
    robe = turned(
        np.hypot(u, v * 1.25) - folds.astype(np.float32), z,
        [(0.20, 0.095), (0.27, 0.10), (0.40, 0.066), (0.50, 0.055), (0.58, 0.073), (0.64, 0.062),
         (0.665, 0.026), (0.69, 0.024)],
    )  # fmt: skip
    at = np.array([-0.015, -ahead])
    head = sphere(xyz, (at[0] + 0.004, at[1] - 0.004, 0.725), 0.05)
    hair = sphere(xyz, (at[0] - 0.012, at[1] + 0.014, 0.765), 0.04)
    shoulder, other = (at[0] - 0.066, at[1], 0.625), (at[0] + 0.066, at[1], 0.625)
    raised = join(
        capsule(xyz, shoulder, (-0.125, at[1] - 0.04, 0.60), 0.022),
        capsule(xyz, (-0.125, at[1] - 0.04, 0.60), (-0.118, at[1] - 0.07, 0.72), 0.019), 0.01,
    )  # fmt: skip
    holding = join(
        capsule(xyz, other, (0.095, at[1] - 0.02, 0.52), 0.022),
        capsule(xyz, (0.095, at[1] - 0.02, 0.52), (0.05, at[1] - 0.10, 0.51), 0.019), 0.01,
    )  # fmt: skip
    bowl = carve(sphere(xyz, (0.045, at[1] - 0.115, 0.535), 0.042),
                 sphere(xyz, (0.045, at[1] - 0.115, 0.57), 0.042))  # fmt: skip
    body = join(join(robe, head, 0.012), hair, 0.006)
    return join(join(body, join(raised, holding), 0.012), bowl, 0.004)


def _offerings(xyz: Floats, plan: _Plan) -> Floats:
    """A jug with a handle on the plinth, and the drum that fell from the broken column."""
    d, (x, y, z) = plan.half_depth, xyz.T
    jx, jy = np.float32(0.02), np.float32(-d - 0.115)
    r = np.hypot(x - jx, y - jy)
    jug = turned(r, z, [(0.10, 0.045), (0.15, 0.05), (0.21, 0.078), (0.26, 0.066), (0.30, 0.034),
                        (0.335, 0.034), (0.35, 0.05), (0.36, 0.05)])  # fmt: skip
    loop = np.hypot(np.hypot(x - jx + 0.072, z - 0.275) - 0.042, y - jy) - 0.014
    jug = join(jug, loop.astype(np.float32), 0.008)
    drum = capsule(xyz, (0.16, -d - 0.20, 0.095), (0.30, -d - 0.235, 0.095), 0.05)
    ends = np.abs((x - 0.23) - 0.25 * (y + d + 0.2175)) - 0.085
    return join(jug, np.maximum(drum, ends.astype(np.float32)))


def _side(plan: _Plan) -> ornament.Relief:
    """The left side's."""
    sketch = ornament.Sketch(plan.half_depth, 0.4)
    ornament.braid(sketch, plan.half_depth * 0.5, 0.34, 3)
    frame = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (plan.half_depth - 0.03, 0.37)
    sketch.line(frame, 0.014, closed=True)
    return sketch.relief(0.022)


def _back(plan: _Plan, seed: int) -> ornament.Relief:
    sketch = ornament.Sketch(plan.half_width, 0.4)
    ornament.rosette(sketch, (0.05, 0.1), 0.2, 9)
    ornament.spiral(sketch, (-0.17, -0.2), 0.11, 3.2)
    ornament.letters(sketch, np.array([-0.34]), 0.05, seed + 1)
    return sketch.relief(0.018)


def _faces(xyz: Floats, plan: _Plan, side: ornament.Relief, back: ornament.Relief) -> Floats:
    """Height of the reliefs: each is felt only near the face that it is cut into."""
    x, y, z = xyz.T
    near = np.float32(0.035)
    height = np.where(np.abs(y - plan.half_depth) < near, back.at(-x, z - 0.55), 0)
    on_left = np.abs(x + plan.half_width) < near
    return np.where(on_left, side.at(y, z - 0.55), height).astype(np.float32)


def _damaged(stone: Floats, xyz: Floats, plan: _Plan) -> Floats:
    for x, y, z, radius in plan.damage:
        stone = carve(stone, sphere(xyz, (x * 1.05, y * 1.05, z), radius), 0.012)
    corner = sphere(xyz, (plan.half_width + 0.12, -plan.half_depth - 0.13, EAVES + 0.01), 0.17)
    return carve(stone, corner, 0.015)
