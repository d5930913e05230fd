"""The lights in which the page shows the surface that `appearance` found."""

from __future__ import annotations

from typing import Any

import numpy as np

from texproj.appearance.harmonics import OPEN_GAINS, basis
from texproj.appearance.light.color_temperature import rgb_of_kelvin
from texproj.appearance.relight.environment import Environment, all_directions, overcast
from texproj.arrays import Doubles
from texproj.errors import InputError
from texproj.preview.surface import Surface
from texproj.project import Project
from texproj.stages.fronts import front
from texproj.stages.photographed_light import SKY_LUX, SUN_LUX, photographed

KELVIN = tuple(range(2000, 12001, 250))
"""Colors of the sun that can be chosen."""


def lights(project: Project, surface: Surface) -> dict[str, Any]:
    """What the page needs to light the surface anew, in the scan's frame.

    up, front, right: unit vectors, as `texproj relight` counts headings from; skies: by name, nine
    spherical harmonics of the irradiance of an open surface, linear RGB; sun: where the photos had
    it, if they had one, and its irradiance over the sky's there; sun_lux: of a clear day; tints:
    linear RGB of each of `kelvin`, of luminance 1.
    """
    up, level = front(project, surface.source.mesh)
    skies = {"overcast": _irradiance(overcast(up, -level, SKY_LUX)).tolist()}
    found = _found(project)
    if found is not None:
        skies["photographed"] = found[0].tolist()
    return {
        "up": up.tolist(),
        "front": level.tolist(),
        "right": np.cross(up, level).tolist(),
        "skies": skies,
        "sun": found[1] if found else None,
        "sun_lux": SUN_LUX,
        "kelvin": KELVIN,
        "tints": rgb_of_kelvin(np.array(KELVIN)).tolist(),
    }


def _irradiance(sky: Environment) -> Doubles:
    """(9, 3) of what an open surface gets from a sky."""
    height, width = sky.radiance.shape[:2]
    local, solid = all_directions(width, height)
    world = local @ np.stack([np.cross(sky.ahead, sky.up), sky.up, sky.ahead]).astype(np.float32)
    values = basis(world.reshape(-1, 3)).astype(np.float64) * solid.reshape(-1, 1)
    return OPEN_GAINS[:, None] * (values.T @ sky.radiance.reshape(-1, 3))


def _found(project: Project) -> tuple[Doubles, dict[str, Any] | None] | None:
    """The sky (9, 3) and the sun that light.json tells of; None where there is none."""
    try:
        found = photographed(project)
    except InputError:
        return None
    told, sun = None, found.sun
    if sun is not None:
        light = found.lux * sun.illuminance
        told = {"direction": sun.toward.tolist(), "irradiance": light.tolist()}
    return OPEN_GAINS[:, None] * found.lux * found.sky, told
