"""How the light of the photos is told from the surface."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from texproj.options.base import EXPERT, STRICT


@dataclass(frozen=True, config=STRICT)
class LightOptions:
    """The light in which the photos were taken, for `texproj appearance`."""

    kind: Annotated[Literal["none", "natural"], EXPERT] = "none"
    """natural: sky and sun, the same in all photos; none: `run` leaves the light in the colors."""

    gray: Annotated[str | None, Field(min_length=1), EXPERT] = None
    """Photo of a 24-patch color chart that faced the light: a path in the project. It fixes tint
    and scale. Without it that of [color] `checker` does."""
