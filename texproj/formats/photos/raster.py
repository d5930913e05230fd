"""Decoded pixels as a file stores them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

Values = NDArray[Any]
"""uint8, uint16 or float32."""


@dataclass(frozen=True, eq=False)
class Raster:
    """Decoded pixels, not yet upright, in the encoding of the file.

    values: (h, w, c) uint8, uint16 or float32 (already linear unless a profile says otherwise),
    c = 1 gray, 3 RGB, 4 CMYK with full value = full ink; alpha: (h, w) of the same type or None.
    """

    values: Values
    alpha: NDArray[Any] | None = None
