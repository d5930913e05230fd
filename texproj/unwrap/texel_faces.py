"""Which face each texel of an atlas belongs to."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.resources.threads import in_parallel
from texproj.unwrap.atlas import Atlas

BATCH = 1 << 12
"""Faces that are turned into spans at once, to bound memory."""


def face_image(atlas: Atlas, page: int) -> NDArray[np.int32]:
    """(h, w) image of a page: the face that holds each texel's center, -1 outside of all.

    A center on an edge that two faces share belongs to exactly one of them.
    """
    width, height = atlas.page_sizes[page]
    image = np.full((height, width), -1, np.int32)
    faces = np.flatnonzero(atlas.page_of_face == page)

    def one(number: int) -> None:
        batch = faces[number * BATCH : (number + 1) * BATCH]
        _draw(image, atlas.uv_px[atlas.faces[batch]], batch)

    in_parallel(one, range(-(-len(faces) // BATCH)))
    return image


def texels_covered(corners: NDArray[np.float64], size: int) -> tuple[int, int]:
    """How many texel centers of a square page lie in triangles (f, 3, 2), and how many would if
    none were counted once for several triangles.
    """
    seen, claims = np.zeros(size * size, bool), 0
    for start in range(0, len(corners), BATCH):
        part = corners[start : start + BATCH]
        row, column, _ = _spans(part, size, size)
        seen[row * size + column] = True
        claims += len(row)
    return int(np.count_nonzero(seen)), claims


def _draw(image: NDArray[np.int32], corners: NDArray[np.float64], faces: NDArray[Any]) -> None:
    """Write face numbers where corners (f, 3, 2) cover texel centers."""
    row, column, owner = _spans(corners, *image.shape)
    image[row, column] = faces[owner]


def _spans(
    corners: NDArray[np.float64], height: int, width: int
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Row, column and triangle of each texel center in a triangle (f, 3, 2), row by row."""
    y = corners[..., 1]
    first = np.clip(np.ceil(y.min(axis=1) - 0.5), 0, height).astype(np.int64)
    last = np.clip(np.ceil(y.max(axis=1) - 0.5), 0, height).astype(np.int64)
    owner, row = ranges(first, last)
    left, right = _crossings(corners, owner, row + 0.5)
    start = np.clip(np.ceil(left - 0.5), 0, width).astype(np.int64)
    stop = np.clip(np.ceil(right - 0.5), 0, width).astype(np.int64)
    span, column = ranges(start, np.maximum(start, stop))
    return row[span], column, owner[span]


def ranges(start: NDArray[np.int64], stop: NDArray[np.int64]) -> tuple[NDArray[Any], NDArray[Any]]:
    """All integers of many half-open ranges: (which range, the integer), in order."""
    count = stop - start
    owner = np.repeat(np.arange(len(start)), count)
    offset = np.cumsum(count) - count
    return owner, np.arange(len(owner)) - np.repeat(offset - start, count)


def _crossings(
    corners: NDArray[np.float64], owner: NDArray[Any], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the row at height y enters and leaves the face `owner`."""
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for i in range(3):
        a, b = corners[:, i], corners[:, (i + 1) % 3]
        upper = np.where((a[:, 1] < b[:, 1])[:, None], a, b)
        lower = np.where((a[:, 1] < b[:, 1])[:, None], b, a)
        rise = lower[:, 1] - upper[:, 1]
        slope = (lower[:, 0] - upper[:, 0]) / np.where(rise > 0, rise, 1)
        x = upper[owner, 0] + (y - upper[owner, 1]) * slope[owner]
        crossed = (upper[owner, 1] <= y) & (y < lower[owner, 1])
        left = np.where(crossed, np.minimum(left, x), left)
        right = np.where(crossed, np.maximum(right, x), right)
    empty = left > right
    return np.where(empty, 0, left), np.where(empty, 0, right)
