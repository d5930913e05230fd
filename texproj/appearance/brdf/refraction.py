"""Light that goes through: Snell's law, total reflection, Beer's law, and a pane of glass."""

from __future__ import annotations

import numpy as np

from texproj.appearance.brdf.fresnel import Dielectric
from texproj.appearance.brdf.model import Color
from texproj.arrays import Bools, Doubles


def refracted(wo: Doubles, ior: float) -> tuple[Doubles, Bools]:
    """(n, 3) directions in which light goes on below the surface, and (n,) whether it does: not
    where it is mirrored totally.

    wo: (n, 3) unit, from the surface to where the light is, z its normal; ior: index below over
    that above.
    """
    sideways = -wo[:, :2] / ior
    square = np.einsum("ij,ij->i", sideways, sideways)
    goes = square < 1
    down = -np.sqrt(np.where(goes, 1 - square, 0))
    return np.column_stack([sideways, down]), goes


def left_of(light: Color, absorption: Color, distance: Doubles) -> Doubles:
    """(n,) or (n, c) what is left of light after (n,) distances in a medium that takes away
    `absorption` a unit of length (Beer 1852).
    """
    return np.exp(-np.multiply.outer(distance, absorption)) * light


def pane(
    cosine: Doubles, ior: float, absorption: float, thickness: float
) -> tuple[Doubles, Doubles]:
    """(n,) parts of light that a flat pane mirrors and lets through, all reflections inside of it
    counted. cosine: (n,) of the light outside to the normal.
    """
    mirror = Dielectric(ior)(cosine)
    inside = np.sqrt(1 - (1 - cosine**2) / ior**2)
    once = left_of(1.0, absorption, thickness / inside)
    through = (1 - mirror) ** 2 * once / (1 - (mirror * once) ** 2)
    return mirror + mirror * once * through, through
