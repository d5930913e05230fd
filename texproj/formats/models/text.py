"""Many numbers as text at once; several times as fast as the formatter, number by number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Text = NDArray[np.uint8]
"""(n, w) characters, one row per number; a zero byte stands for no character."""

BLOCK_DIGITS = 4
BLOCK = 10**BLOCK_DIGITS
DIGITS_OF_BLOCK = np.frombuffer("".join(f"{i:04d}" for i in range(BLOCK)).encode(), np.uint8)
DIGITS_OF_BLOCK = DIGITS_OF_BLOCK.reshape(BLOCK, BLOCK_DIGITS)

LARGEST = 1e18
"""What fits 64 bits, with some room."""


def integers(numbers: NDArray[np.integer]) -> Text:
    """Text of (n,) integers that are not negative."""
    return _digits(numbers.astype(np.int64), 1)


def decimals(values: NDArray[np.float64], places: int) -> Text:
    """Text of (n,) finite values with so many decimal places (at least 1), rounded."""
    if not (np.abs(values) * 10.0**places < LARGEST).all():
        return _formatted(values, places)
    scaled = np.rint(values * 10.0**places).astype(np.int64)
    digits = _digits(np.abs(scaled), places + 1)
    whole = digits.shape[1] - places
    out = np.empty((len(values), digits.shape[1] + 2), np.uint8)
    out[:, 0] = np.where(scaled < 0, ord("-"), 0)
    out[:, 1 : whole + 1] = digits[:, :whole]
    out[:, whole + 1] = ord(".")
    out[:, whole + 2 :] = digits[:, whole:]
    return out


def lines(parts: Sequence[bytes | Text]) -> bytes:
    """One line per row: constant characters and columns of text beside each other."""
    columns = [np.frombuffer(p, np.uint8)[None] if isinstance(p, bytes) else p for p in parts]
    ends = np.cumsum([0, *(column.shape[1] for column in columns)])
    rows = np.empty((max(len(column) for column in columns), ends[-1]), np.uint8)
    for column, first, last in zip(columns, ends, ends[1:], strict=False):
        rows[:, first:last] = column
    return rows[rows != 0].tobytes()


def _digits(numbers: NDArray[np.int64], least: int) -> Text:
    """Decimal digits, without leading zeros beyond `least` digits."""
    largest = int(numbers.max(initial=0))
    width = max(len(str(largest)), least)
    blocks = -(-width // BLOCK_DIGITS)
    out = np.empty((len(numbers), blocks * BLOCK_DIGITS), np.uint8)
    rest = numbers.astype(np.uint32) if largest < 1 << 32 else numbers
    for block in range(blocks - 1, -1, -1):
        rest, low = np.divmod(rest, rest.dtype.type(BLOCK))
        out[:, block * BLOCK_DIGITS : (block + 1) * BLOCK_DIGITS] = DIGITS_OF_BLOCK[low]
    out = out[:, -width:]
    for place in range(least, width):
        out[numbers < 10**place, width - 1 - place] = 0
    return out


def _formatted(values: NDArray[np.float64], places: int) -> Text:
    """The same by the formatter: numbers of any size."""
    texts = [f"{value:.{places}f}".encode() for value in values.tolist()]
    width = max(map(len, texts))
    return np.frombuffer(b"".join(t.ljust(width, b"\0") for t in texts), np.uint8).reshape(
        -1, width
    )
