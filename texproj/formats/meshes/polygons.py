"""Numbers of text files, and polygons as triangles."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.errors import excerpt
from texproj.formats.foreign import Broken

Vertices = NDArray[np.float64]
Faces = NDArray[np.int32]
Ints = NDArray[np.int64]

NO_FACES: Faces = np.zeros((0, 3), np.int32)


def numbers(text: bytes, dtype: type[np.generic]) -> NDArray[Any]:
    """All white-space separated numbers of a text. Raises Broken for other words."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
        try:
            return np.fromstring(text, dtype, sep=" ")
        except (DeprecationWarning, ValueError):
            raise Broken("a word where a number should be") from None


def positions(lines: Sequence[bytes]) -> Vertices:
    """(n, 3) x y z of lines that may go on with other numbers. Raises Broken that counts lines."""
    columns = np.fromiter((len(line.split()) for line in lines), np.int64, len(lines))
    if len(columns) and columns.min() < 3:
        short = int(np.argmin(columns))
        raise Broken(f"vertex {short + 1} has {columns[short]} numbers")
    if len(columns) and columns.min() == columns.max() and not any(b"#" in v for v in lines):
        values = numbers(b"\n".join(lines), np.float64)
        return np.ascontiguousarray(values.reshape(len(lines), -1)[:, :3])
    try:
        return np.array([line.split()[:3] for line in lines], np.float64).reshape(-1, 3)
    except ValueError:
        raise Broken("a word where a number should be") from None


def counted_polygons(lines: Sequence[bytes]) -> Faces:
    """Triangles of lines `n i1 .. in ...`. Raises Broken for lines that are too short."""
    if not lines:
        return NO_FACES
    width = len(lines[0].split())
    values = numbers(lines[0], np.float64)
    sides = int(values[0]) if len(values) and np.isfinite(values[0]) else 0
    if 3 <= sides < width and all(len(line.split()) == width for line in lines):
        table = numbers(b"\n".join(lines), np.float64).reshape(len(lines), width)
        if (table[:, 0] == sides).all():
            flat = table[:, 1 : sides + 1].ravel()
            return fans(_whole(flat), np.full(len(lines), sides))
    flat_words: list[bytes] = []
    counts = np.zeros(len(lines), np.int64)
    for i, line in enumerate(lines):
        words = line.split()
        counts[i] = int(words[0]) if words[0].isdigit() and len(words[0]) < 10 else -1
        if not 0 <= counts[i] < len(words):
            told = excerpt(words[0].decode("latin-1"), 20)
            raise Broken(f"face {i + 1} has {len(words) - 1} corners of {told}")
        flat_words += words[1 : counts[i] + 1]
    return fans(_whole(numbers(b" ".join(flat_words), np.float64)), counts)


def fans(corners: Ints, counts: Ints) -> Faces:
    """(F, 3) triangles around the first corner of each polygon; those of two corners vanish.

    corners: indices of all polygons, one after the other; counts: how many each has.
    """
    starts = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), triangles)
    nth = np.arange(len(polygon)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    first = starts[polygon]
    return int32(corners[np.stack([first, first + nth + 1, first + nth + 2], axis=1)])


def int32(indices: NDArray[Any]) -> Faces:
    """Indices that do not fit stay out of range."""
    return np.clip(indices, -1, np.iinfo(np.int32).max).astype(np.int32)


def _whole(values: NDArray[np.float64]) -> Ints:
    """Indices that were read as floats; what is none of them is out of range."""
    good = (values == np.floor(values)) & (np.abs(values) < 2**31)
    return np.where(good, values, -1).astype(np.int64)
