"""Reliefs and inscriptions as height images, drawn with lines and looked up on flat faces."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats

SCALE = 1000
"""Pixels per metre of a relief."""


@dataclass(frozen=True, eq=False)
class Relief:
    """Heights in metres over a rectangle of +-half_u x +-half_v metres."""

    height: Floats
    half_u: float
    half_v: float

    def at(self, u: Floats, v: Floats) -> Floats:
        """(n,) heights at (n,) positions, 0 outside; u right, v up."""
        column = (u + self.half_u) * SCALE - 0.5
        row = (self.half_v - v) * SCALE - 0.5
        columns, rows = (np.append(a, a[:0]).reshape(-1, 1) for a in (column, row))
        out = [
            cv2.remap(self.height, c, r, cv2.INTER_LINEAR, borderValue=0)
            for c, r in zip(_split(columns), _split(rows), strict=True)
        ]
        return np.concatenate(out).ravel()


def _split(column: Floats) -> list[Floats]:
    """Pieces short enough for cv2.remap, whose sizes are 16-bit."""
    limit = 32000
    return [np.ascontiguousarray(column[i : i + limit]) for i in range(0, len(column), limit)]


class Sketch:
    """A drawing board of +-half_u x +-half_v metres; every mark is a groove of given depth."""

    def __init__(self, half_u: float, half_v: float) -> None:
        self.half_u, self.half_v = half_u, half_v
        self._ink = np.zeros((round(2 * half_v * SCALE), round(2 * half_u * SCALE)), np.uint8)

    def line(self, uv: NDArray[np.float64], width: float, closed: bool = False) -> None:
        """A polyline of (k, 2) points, `width` metres wide."""
        points = (uv - (-self.half_u, self.half_v)) * (SCALE, -SCALE)
        cv2.polylines(
            self._ink, [np.round(points * 16).astype(np.int32)], closed, 255,
            max(1, round(width * SCALE)), cv2.LINE_AA, 4,
        )  # fmt: skip

    def circle(self, center: tuple[float, float], radius: float, width: float) -> None:
        """A ring; the line's middle lies on the radius."""
        angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        ring = np.stack([np.cos(angle), np.sin(angle)], 1) * radius + center
        self.line(ring, width, closed=True)

    def relief(self, depth: float, softness: float = 0.002) -> Relief:
        """Heights: 0 on bare ground, -depth in the grooves, with sloping flanks."""
        soft = cv2.GaussianBlur(self._ink.astype(np.float32) / 255, (0, 0), softness * SCALE)
        return Relief(-depth * soft, self.half_u, self.half_v)


def rosette(sketch: Sketch, center: tuple[float, float], radius: float, petals: int) -> None:
    """A flower of petals in rings."""
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    for share in (0.42, 0.75):
        r = radius * share * (1 + 0.18 * np.abs(np.cos(petals * angle / 2)))
        uv = np.stack([r * np.cos(angle), r * np.sin(angle)], 1) + center
        sketch.line(uv, 0.007, closed=True)
    for k in range(petals):
        direction = np.array([np.cos(2 * np.pi * k / petals), np.sin(2 * np.pi * k / petals)])
        sketch.line(np.outer([0.16, 0.7], direction) * radius + center, 0.006)
    for share in (0.14, 0.97):
        sketch.circle(center, radius * share, 0.008)


def braid(sketch: Sketch, half_u: float, half_v: float, strands: float) -> None:
    """Two strands that cross again and again along v."""
    v = np.linspace(-half_v, half_v, 400)
    for phase in (0, np.pi):
        u = half_u * np.sin(strands * np.pi * v / half_v + phase)
        sketch.line(np.stack([u, v], 1), 0.011)
    for k in np.arange(-strands + 0.5, strands):
        sketch.circle((0.0, k * half_v / strands), half_u * 0.22, 0.006)


def spiral(sketch: Sketch, center: tuple[float, float], radius: float, turns: float) -> None:
    """A spiral from the center; negative turns run clockwise."""
    t = np.linspace(0.08, 1, 300)
    angle = 2 * np.pi * turns * t
    uv = np.stack([np.cos(angle), np.sin(angle)], 1) * (radius * t)[:, None] + center
    sketch.line(uv, 0.008)


def letters(sketch: Sketch, rows: NDArray[np.float64], size: float, seed: int) -> None:
    """Rows of made-up signs, each of three or four strokes between the nodes of a 3 x 3 grid."""
    rng = np.random.default_rng([seed, 101])
    for v in rows:
        for u in np.arange(-sketch.half_u + size, sketch.half_u - 0.6 * size, 1.05 * size):
            if rng.random() < 0.12:
                continue
            nodes = rng.permutation(9)[: rng.integers(3, 5)]
            grid = np.stack([nodes % 3, nodes // 3], 1) - 1.0
            sketch.line(grid * (0.34 * size, 0.45 * size) + (u, v), 0.0045)
