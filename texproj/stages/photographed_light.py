"""The light that `appearance` found in the photos, as light to show things in."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from texproj.appearance.harmonics import BASES, OPEN_GAINS, basis
from texproj.appearance.relight import Environment, Sun
from texproj.appearance.relight.environment import all_directions
from texproj.appearance.sun import spiral
from texproj.arrays import Doubles, Floats
from texproj.errors import InputError
from texproj.photo import LUMINANCE
from texproj.project import Project
from texproj.stages.appearance_files import LIGHT

SUN_LUX, SKY_LUX = 90_000.0, 12_000.0
"""Of a clear day: square to the sun, and of level ground by the sky."""

NORMALS = 500
"""Directions among which an open surface that is lit best is sought."""

ROUNDS = 30
"""Of making a picture of a sky bright nowhere below 0 and lighting as its harmonics do."""

SIZE = 64, 32


@dataclass(frozen=True, eq=False)
class PhotographedLight:
    """sky: (9, 3) spherical harmonics of linear RGB radiance in the scan's frame; sun: or None; in
    the unit of the photos' linear colors, 1 = white.
    """

    sky: Doubles
    sun: Sun | None

    @cached_property
    def lux(self) -> float:
        """By how much it is to be multiplied for cd/m2 and lux. No photo tells it: what is lit best
        is taken for what a clear day gives it, or, without a sun, an overcast one.
        """
        normals = spiral(NORMALS)
        light = basis(normals) * OPEN_GAINS @ self.sky
        usual = SKY_LUX
        if self.sun is not None:
            light = light + np.maximum(normals @ self.sun.toward, 0)[:, None] * self.sun.illuminance
            usual += SUN_LUX
        return usual / max(float((light @ LUMINANCE).max()), 1e-9)

    def shown(self, up: Doubles, ahead: Doubles) -> tuple[Environment, tuple[Sun, ...]]:
        """A picture of the sky, cd/m2, and the sun, lux."""
        local, solid = all_directions(*SIZE)
        world = local @ np.stack([np.cross(ahead, up), up, ahead]).astype(np.float32)
        values = basis(world.reshape(-1, 3)).astype(np.float64)
        seen = _nowhere_dark(self.sky, values, solid.reshape(-1, 1))
        radiance: Floats = (self.lux * seen).astype(np.float32).reshape(SIZE[1], SIZE[0], 3)
        suns = () if self.sun is None else (Sun(self.sun.toward, self.lux * self.sun.illuminance),)
        return Environment(radiance, up, ahead), suns


def _nowhere_dark(sky: Doubles, values: Doubles, solid: Floats) -> Doubles:
    """(n, 3) radiance, nowhere below 0, whose harmonics are those of a sky as nearly as that goes:
    nine numbers ring below 0 beside a bright side, each channel elsewhere, and what is only cut
    there is too bright and of another tint. values: (n, 9) of the harmonics; solid: (n, 1) angles.
    """
    told = sky.copy()
    for _ in range(ROUNDS):
        told += sky - values.T @ (solid * np.maximum(values @ told, 0))
    return np.maximum(values @ told, 0)


def photographed(project: Project) -> PhotographedLight:
    """The light that `appearance` found. Raises InputError where light.json tells of none."""
    path = project.out / LIGHT
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        sky = np.array(told["sky"], np.float64).reshape(BASES, 3)
        toward, light = told["sun"], told.get("sun_irradiance")
        sun = Sun(_vector(toward), _vector(light)) if toward is not None else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        sky, sun = np.full((BASES, 3), np.nan), None
    if not np.isfinite(sky).all() or (sun is not None and not sun.toward.any()):
        raise InputError(
            f"{path} tells of no sky; natural light is shown again only where it was found"
        )
    return PhotographedLight(sky, sun)


def _vector(told: Any) -> Doubles:
    """(3,) finite numbers. Raises ValueError or TypeError for anything else."""
    vector: Doubles = np.array(told, np.float64).reshape(3)
    if not np.isfinite(vector).all():
        raise ValueError("not finite")
    return vector
