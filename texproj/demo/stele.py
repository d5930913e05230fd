"""A stele: plinth with an inscription, arched niche with a free-standing column, cornice with
dentils, gable, ornaments cut into its back and sides, and some damage.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Floats
from texproj.demo import ornament
from texproj.demo.shapes import Field, box, carve, extruded, join, sphere, turned


@dataclass(frozen=True)
class _Plan:
    """Measures in metres that the seed varies."""

    half_width: float
    half_depth: float
    arch: float
    flutes: int
    twist: float
    petals: int
    damage: tuple[tuple[float, ...], ...]


BODY = (0.14, 0.96)
"""Lowest and highest z of the body between plinth and cornice."""
SPRING = 0.62
"""Height where the niche's arch begins."""
SILL = 0.23
"""Height of the niche's floor."""
TOP = 1.31
"""Height of the gable's ridge."""


def _plan(seed: int) -> _Plan:
    rng = np.random.default_rng([seed, 1])
    width, depth = rng.uniform(0.32, 0.37), rng.uniform(0.19, 0.23)
    corners = rng.choice([-1.0, 1.0], (9, 2)) * (width + 0.09, depth + 0.08)
    heights = rng.choice([0.05, 0.15, 0.5, 0.97, 1.03, 1.06], 9)
    sizes = rng.uniform(0.03, 0.10, 9)
    damage = tuple(
        (*map(float, c), float(h), float(s))
        for c, h, s in zip(corners, heights, sizes, strict=True)
    )
    return _Plan(
        width, depth, rng.uniform(0.16, 0.19), int(rng.integers(7, 13)),
        float(rng.choice([0.0, 9.0, -12.0])), int(rng.integers(7, 13)), damage,
    )  # fmt: skip


def solid(seed: int) -> tuple[Field, tuple[float, float, float]]:
    """The stele's distance field and the half sizes (x, y) and height of a box around it."""
    plan = _plan(seed)
    front, back, side = _front(plan, seed), _back(plan, seed), _side(plan)

    def field(xyz: Floats) -> Floats:
        x, y, z = xyz.T
        ornaments = _faces(xyz, plan, front, back, side)
        stone = join(_mass(xyz, plan) - ornaments, _cornice(xyz, plan))
        stone = join(stone, _gable(x, y, z, plan))
        stone = carve(stone, _niche(x, y, z, plan), 0.006)
        stone = join(stone, _archivolt(x, y, z, plan), 0.004)
        stone = join(stone, _columns(x, y, z, plan), 0.006)
        return _damaged(stone, xyz, plan)

    return field, (plan.half_width + 0.16, plan.half_depth + 0.16, TOP + 0.09)


def _mass(xyz: Floats, plan: _Plan) -> Floats:
    w, d = plan.half_width, plan.half_depth
    middle = (BODY[0] + BODY[1]) / 2
    body = box(xyz, (0, 0, middle), (w, d, (BODY[1] - BODY[0]) / 2), 0.008)
    plinth = box(xyz, (0, 0, 0.06), (w + 0.1, d + 0.09, 0.06), 0.01)
    step = box(xyz, (0, 0, 0.13), (w + 0.055, d + 0.05, 0.04), 0.02)
    return join(join(body, step, 0.01), plinth, 0.006)


def _cornice(xyz: Floats, plan: _Plan) -> Floats:
    w, d = plan.half_width, plan.half_depth
    lower = box(xyz, (0, 0, 0.955), (w + 0.03, d + 0.03, 0.018), 0.012)
    upper = box(xyz, (0, 0, 1.02), (w + 0.1, d + 0.09, 0.022), 0.008)
    pitch = 0.062
    local = xyz.copy()
    local[:, :2] = (xyz[:, :2] / pitch - np.round(xyz[:, :2] / pitch)) * pitch
    teeth = box(local, (0, 0, 0.985), (0.019, 0.019, 0.03), 0.003)
    inside = box(xyz, (0, 0, 0.985), (w + 0.075, d + 0.065, 0.04))
    return join(join(lower, upper), np.maximum(teeth, inside))


def _gable(x: Floats, y: Floats, z: Floats, plan: _Plan) -> Floats:
    half, rise = plan.half_width + 0.085, TOP - 1.04
    slope = np.float32(np.hypot(half, rise))
    roof = np.abs(x) * np.float32(rise) + (z - np.float32(1.04 + rise)) * np.float32(half)
    triangle: Floats = np.maximum(roof / slope, np.float32(1.035) - z)
    whole = extruded(triangle, y, plan.half_depth + 0.07)
    beyond: Floats = np.abs(y) - np.float32(plan.half_depth + 0.075)
    field = extruded(triangle + np.float32(0.045), beyond, 0.03)
    boss = turned(
        np.hypot(x, z - 1.135), -y,
        [(0, 0.075), (plan.half_depth + 0.05, 0.07), (plan.half_depth + 0.085, 0.02)],
    )  # fmt: skip
    knob_x = np.abs(x) - half + 0.03
    knobs = np.hypot(np.hypot(knob_x, y / 2.2), z - 1.075) - 0.052
    crown = np.hypot(np.hypot(x, y / 1.8), z - TOP + 0.005) - 0.055
    return join(join(carve(whole, field, 0.004), boss), join(knobs, crown), 0.015)


def _arch(x: Floats, z: Floats, plan: _Plan) -> Floats:
    """Distance of a wall's points from the outline of the niche, negative inside of it."""
    rounded = np.hypot(x, np.maximum(z - SPRING, 0)) - np.float32(plan.arch)
    return np.maximum(rounded, SILL - z)


def _niche(x: Floats, y: Floats, z: Floats, plan: _Plan) -> Floats:
    return extruded(_arch(x, z, plan), y + plan.half_depth, plan.half_depth + 0.1)


def _archivolt(x: Floats, y: Floats, z: Floats, plan: _Plan) -> Floats:
    ring = np.maximum(np.abs(_arch(x, z, plan) - 0.022) - 0.02, SILL - z)
    angle = np.arctan2(x, np.maximum(z - SPRING, 1e-3))
    joints = (np.abs(np.sin(angle * 7.5)) < 0.09) & (z > SPRING)
    groove = joints.astype(np.float32) * np.float32(0.006)
    return extruded(ring + groove, y + plan.half_depth, 0.022)


def _columns(x: Floats, y: Floats, z: Floats, plan: _Plan) -> Floats:
    middle = _column(x, y + plan.half_depth - 0.055, z, plan, 0.042)
    across = np.abs(x) - np.float32(plan.half_width - 0.065)
    sides = _column(across, y + plan.half_depth + 0.012, z, plan, 0.036)
    return join(middle, sides)


def _column(x: Floats, y: Floats, z: Floats, plan: _Plan, radius: float) -> Floats:
    """A fluted shaft with base and capital; it reaches into the stone at both ends."""
    angle = np.arctan2(y, x)
    top = SPRING + plan.arch if radius > 0.04 else BODY[1] - 0.02
    shaft = (z > 0.30) & (z < top - 0.1)
    flutes = np.where(shaft, np.abs(np.sin((angle * plan.flutes + plan.twist * z * 4) / 2)), 0.5)
    profile = [
        (0.15, 1.5), (0.245, 1.5), (0.25, 1.35), (0.265, 1.45), (0.28, 1.2), (0.295, 1.0),
        (top - 0.11, 0.85), (top - 0.095, 1.15), (top - 0.085, 0.95), (top - 0.03, 1.7),
        (top - 0.025, 1.75), (top, 1.75), (top + 0.03, 1.6),
    ]  # fmt: skip
    scaled = [(height, r * radius) for height, r in profile]
    return turned(np.hypot(x, y) - (0.3 * radius * (flutes - 0.5)).astype(np.float32), z, scaled)


def _front(plan: _Plan, seed: int) -> ornament.Relief:
    sketch = ornament.Sketch(plan.half_width + 0.09, 0.048)
    ornament.letters(sketch, np.array([0.02, -0.019]), 0.034, seed)
    return sketch.relief(0.006, 0.0012)


def _back(plan: _Plan, seed: int) -> ornament.Relief:
    sketch = ornament.Sketch(plan.half_width, 0.4)
    ornament.rosette(sketch, (0, 0.12), 0.2, plan.petals)
    for sign in (-1, 1):
        ornament.spiral(sketch, (sign * 0.17, -0.2), 0.11, sign * 3.2)
    ornament.letters(sketch, np.array([-0.34]), 0.05, seed + 1)
    frame = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (plan.half_width - 0.025, 0.38)
    sketch.line(frame, 0.01, closed=True)
    return sketch.relief(0.016)


def _side(plan: _Plan) -> ornament.Relief:
    sketch = ornament.Sketch(plan.half_depth, 0.4)
    ornament.braid(sketch, plan.half_depth * 0.55, 0.36, 3)
    frame = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (plan.half_depth - 0.025, 0.38)
    sketch.line(frame, 0.01, closed=True)
    return sketch.relief(0.014)


def _faces(
    xyz: Floats, plan: _Plan, front: ornament.Relief, back: ornament.Relief, side: ornament.Relief
) -> Floats:
    """Height of all reliefs: each is felt only near the face that it is cut into."""
    x, y, z = xyz.T
    near = np.float32(0.03)
    on_front = (np.abs(y + plan.half_depth + 0.09) < near) & (z < 0.12)
    on_back = np.abs(y - plan.half_depth) < near
    on_side = np.abs(np.abs(x) - plan.half_width) < near
    height = np.where(on_front, front.at(x, z - 0.062), 0)
    height = np.where(on_back, back.at(-x, z - 0.55), height)
    return np.where(on_side, side.at(y, z - 0.55), height).astype(np.float32)


def _damaged(stone: Floats, xyz: Floats, plan: _Plan) -> Floats:
    for x, y, z, radius in plan.damage:
        stone = carve(stone, sphere(xyz, (x * 1.08, y * 1.08, z), radius), 0.012)
    return stone
