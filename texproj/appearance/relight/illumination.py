"""What a surface is lit by."""

from __future__ import annotations

from dataclasses import dataclass

from texproj.appearance.relight.environment import Environment
from texproj.arrays import Doubles


@dataclass(frozen=True, eq=False)
class Sun:
    """Light from one direction. toward: (3,) unit vector to it, world; illuminance: (3,) linear
    RGB square to it, lux.
    """

    toward: Doubles
    illuminance: Doubles


@dataclass(frozen=True, eq=False)
class Lamp:
    """A point that shines alike in all directions. place: (3,) world; intensity: (3,) linear RGB,
    candela where a unit of the scan is a metre, else lux at one unit.
    """

    place: Doubles
    intensity: Doubles


@dataclass(frozen=True, eq=False)
class Illumination:
    """All lights at once. environment: what is far away, None = dark."""

    environment: Environment | None = None
    suns: tuple[Sun, ...] = ()
    lamps: tuple[Lamp, ...] = ()
