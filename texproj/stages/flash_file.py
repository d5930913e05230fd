"""flash.json: what a white wall told of a flash."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Strict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from texproj.errors import InputError
from texproj.formats.documents import read_json
from texproj.options.base import STRICT

if TYPE_CHECKING:
    from texproj.appearance.flash.lamp import Lamp

FORMAT: Literal["texproj-flash"] = "texproj-flash"
Number = Annotated[float, Strict()]
"""A number of JSON: no word of one, and neither true nor false."""
Vector = tuple[Number, Number, Number]
FARTHEST = 1e6
"""Of a flash from its lens, units of the scan: more is a slip of the pen, and single precision ends
at it.
"""
UNIT_FROM = 0.5
"""Length of the axis, which is written as a unit vector: shorter ones are none that was rounded."""
STRONGEST = 1e12
"""Light of a flash at one unit of the scan, 1 = white: a hundred metres in millimetres are 1e10."""
STEEPEST = 20.0
"""Log of the light against that in the middle: single precision ends at a few times that."""
TRIED = 200
"""Places, of an angle or a picture, at which that is looked at."""


@dataclass(frozen=True, config=STRICT)
class FlashFile:
    """Keys of the file; see `Lamp`. Angles in degrees, lengths in units of the board's square."""

    format: Literal["texproj-flash"]
    version: Literal[1]
    lamp: Vector
    axis: Vector
    profile: tuple[Number, ...]
    widest_deg: Number
    vignetting: tuple[Number, ...]
    reach: Number
    intensity: Number | None
    quality: dict[str, Number]


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
    from texproj.appearance.flash.lamp import ANGLE_SCALE, Lamp  # noqa: PLC0415 - slow to load

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
    axis, widest = np.array(told.axis), float(np.cos(np.radians(told.widest_deg)))
    if not np.isfinite(numbers).all():
        raise InputError(f"{path}: a number is not finite; write it anew")
    bounds = {
        "lamp": max(map(abs, told.lamp)) <= FARTHEST,
        "axis": max(map(abs, told.axis)) <= 1 and bool(np.linalg.norm(axis) > UNIT_FROM),
        "profile": _is_gentle(told.profile, ANGLE_SCALE * (1 - widest)),
        "vignetting": _is_gentle(told.vignetting, min(told.reach, 1)),
        "widest_deg": 0 < told.widest_deg <= 180,
        "reach": told.reach > 0,
        "intensity": told.intensity is None or 1 / STRONGEST <= told.intensity <= STRONGEST,
    }
    wrong = [key for key, right in bounds.items() if not right]
    if wrong:
        raise InputError(
            f"{path}: {wrong[0]} = {getattr(told, wrong[0])} cannot be of a flash; write it anew by"
            " `texproj calibrate-flash`"
        )
    return Lamp(
        np.array(told.lamp), axis / np.linalg.norm(axis), told.profile, widest, told.vignetting,
        told.reach, told.intensity,
    )  # fmt: skip


def _is_gentle(coefficients: tuple[float, ...], end: float) -> bool:
    """Whether a polynomial of log light is of a lamp or a lens, from 0 to `end`."""
    from texproj.appearance.flash.lamp import polynomial  # noqa: PLC0415 - slow to load

    with np.errstate(over="ignore", invalid="ignore"):
        log = polynomial(coefficients, np.linspace(0, end, TRIED))
    return bool((np.abs(log) <= STEEPEST).all())
