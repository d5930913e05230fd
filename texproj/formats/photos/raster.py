"""What a photo file holds, as stored: its header's facts and its decoded pixels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

Values = NDArray[Any]
"""uint8, uint16 or float32."""

Tags = dict[int, Any]
"""EXIF values by number."""


@dataclass(frozen=True, eq=False)
class Raster:
    """Decoded pixels, not yet upright, in the encoding of the file.

    values: (h, w, c) uint8, uint16 or float32 (already linear unless a profile says otherwise),
    c = 1 gray, 3 RGB, 4 CMYK with full value = full ink; alpha: (h, w) of the same type or None.
    """

    values: Values
    alpha: NDArray[Any] | None = None


@dataclass(frozen=True, eq=False)
class Stored:
    """The facts of a file's header, as its format tells them.

    kind: a key of `KINDS`; width, height: of the stored picture, pixels; channels: 1 gray, 3 RGB,
    4 CMYK; profile: what stands in place of an ICC profile; tags, exif: EXIF values of the main
    directory and of the photo's; orientation: EXIF 1..8 where the format tells it beside EXIF.
    """

    kind: str
    width: int
    height: int
    channels: int
    profile: Any = None
    tags: Mapping[int, Any] = field(default_factory=dict)
    exif: Mapping[int, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    orientation: int | None = None
