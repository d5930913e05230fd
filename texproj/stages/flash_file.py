"""flash.json: what a white wall told of a flash."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from texproj.errors import InputError
from texproj.formats.documents import read_json
from texproj.options.base import STRICT

if TYPE_CHECKING:
    from texproj.appearance.flash.lamp import Lamp

FORMAT: Literal["texproj-flash"] = "texproj-flash"
Vector = tuple[float, float, float]
FARTHEST = 1e6
"""Of a flash from its lens, units of the scan: more is a slip of the pen, and single precision ends
at it.
"""
STEEPEST = 1e3
"""Coefficient of log light; measured ones are below 10."""


@dataclass(frozen=True, config=STRICT)
class FlashFile:
    """Keys of the file; see `Lamp`. Angles in degrees, lengths in units of the board's square."""

    format: Literal["texproj-flash"]
    version: Literal[1]
    lamp: Vector
    axis: Vector
    profile: tuple[float, ...]
    widest_deg: float
    vignetting: tuple[float, ...]
    reach: float
    intensity: float | None
    quality: dict[str, float]


def flash_text(lamp: Lamp, quality: dict[str, float]) -> str:
    """The text of the file."""
    x, y, z = (float(value) for value in lamp.place)
    a, b, c = (float(value) for value in lamp.axis)
    widest = float(np.degrees(np.arccos(np.clip(lamp.widest, -1, 1))))
    content = FlashFile(
        FORMAT, 1, (x, y, z), (a, b, c), lamp.profile, widest, lamp.vignetting, lamp.reach,
        lamp.intensity, quality,
    )  # fmt: skip
    return json.dumps(asdict(content), indent=1) + "\n"


def read_flash(path: Path) -> Lamp:
    """The flash of a file. Raises InputError that names what is wrong."""
    from texproj.appearance.flash.lamp import Lamp  # noqa: PLC0415 - slow to load

    content: Any = read_json(path)
    try:
        told = TypeAdapter(FlashFile).validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(
            f"{path}: {key or 'it'} is not as `texproj calibrate-flash` writes it"
            f"{': ' + first['msg'].lower() if key else ''}; write it anew"
        ) from None
    numbers = (*told.lamp, *told.axis, *told.profile, *told.vignetting, told.widest_deg, told.reach)
    axis = np.array(told.axis)
    if not np.isfinite(numbers).all() or not axis.any():
        raise InputError(f"{path}: a number is not finite; write it anew")
    bounds = {
        "lamp": max(map(abs, told.lamp)) <= FARTHEST,
        "profile": all(abs(number) <= STEEPEST for number in told.profile),
        "vignetting": all(abs(number) <= STEEPEST for number in told.vignetting),
        "widest_deg": 0 < told.widest_deg <= 180,
        "reach": told.reach > 0,
        "intensity": told.intensity is None or 0 < told.intensity < np.inf,
    }
    wrong = [key for key, right in bounds.items() if not right]
    if wrong:
        raise InputError(
            f"{path}: {wrong[0]} = {getattr(told, wrong[0])} cannot be of a flash; write it anew by"
            " `texproj calibrate-flash`"
        )
    widest = float(np.cos(np.radians(told.widest_deg)))
    return Lamp(
        np.array(told.lamp), axis / np.linalg.norm(axis), told.profile, widest, told.vignetting,
        told.reach, told.intensity,
    )  # fmt: skip
