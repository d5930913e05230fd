"""How the light of the photos is told from the surface."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from texproj.options.base import EXPERT, STRICT


@dataclass(frozen=True, config=STRICT)
class LightOptions:
    """The light in which the photos were taken, for `texproj appearance`."""

    kind: Annotated[Literal["none", "natural", "flash", "turntable", "polarized"], EXPERT] = "none"
    """natural: sky and sun, the same in all photos; flash: the only light is a flash on the camera;
    turntable: the object was turned, lamps and camera stood still; polarized: photos-crossed/ has
    each photo again through crossed polarizers, under a flash (give `position`) or lamps; none:
    `run` leaves the light in the colors, `appearance` tells natural light and turntable apart."""

    gray: Annotated[str | None, Field(min_length=1), EXPERT] = None
    """Photo of a 24-patch color chart that faced the light: a path in the project. It fixes tint
    and scale. Without it that of [color] `checker` does. Not for a flash."""

    position: Annotated[tuple[float, float, float] | None, EXPERT] = None
    """Where the flash is, in units of the scan: right of the lens, below it, in front of it, as
    seen from behind the camera held level."""

    profile: Annotated[str | None, Field(min_length=1), EXPERT] = None
    """What `texproj calibrate-flash` wrote of the flash: a path in the project. It tells
    `position` too."""
