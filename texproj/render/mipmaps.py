"""A page of a texture at all its resolutions, read where pixels lie on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.photo import linear_from_srgb

WHITE = np.float32(65535)
"""Linear 1 in mipmaps: 16 bits keep 20 steps in the darkest one of 8-bit sRGB."""

ROW = 1024
"""OpenCV remaps images of at most 32767 columns, so places come in rows."""


@dataclass(frozen=True, eq=False)
class Footprint:
    """Where pixels lie on the texture: x, y (n,) from its top left corner as parts of its size, and
    area (n,) the part of the page that one pixel covers.
    """

    x: Floats
    y: Floats
    area: Floats

    def chosen(self, which: NDArray[Any]) -> Footprint:
        """Some of the pixels."""
        return Footprint(self.x[which], self.y[which], self.area[which])


class Mipmaps:
    """A page, halved again and again (Williams 1983), in linear light."""

    def __init__(self, page: NDArray[Any], colors: bool = True) -> None:
        """page: (h, w, 3 or more) uint8 or uint16, sRGB-encoded, or, where they are no colors,
        numbers. It is kept as it is: its halves, made here, are two thirds of the memory of an
        8-bit page.
        """
        self._page = page[..., :3]
        top = np.iinfo(page.dtype).max
        table = linear_table(page.dtype) if colors else np.arange(top + 1) / top
        self._table = np.round(table * WHITE).astype(np.uint16)
        self._smaller: list[NDArray[np.uint16]] = []
        whole = np.ascontiguousarray(self._page)
        image = cv2.LUT(whole, self._table) if whole.itemsize == 1 else self._table[whole]
        while min(image.shape[:2]) > 1:
            half = (image.shape[1] // 2, image.shape[0] // 2)
            image = cv2.resize(image, half, interpolation=cv2.INTER_AREA)
            self._smaller.append(image)

    def at(self, place: Footprint) -> Floats:
        """(n, 3) linear color of the page, trilinear between its levels."""
        texels = np.maximum(place.area * np.float32(self._page.shape[0] * self._page.shape[1]), 1)
        level = np.minimum(np.log2(texels) / 2, np.float32(len(self._smaller)))
        lower = level.astype(np.intp)
        color = np.empty((len(level), 3), np.float32)
        for number in np.unique(lower):
            here = np.flatnonzero(lower == number)
            x, y, part = place.x[here], place.y[here], (level[here] - number)[:, None]
            fine = self._read(number, x, y)
            color[here] = fine
            if part.any():
                color[here] += part * (self._read(number + 1, x, y) - fine)
        return color

    def _read(self, number: int, x: Floats, y: Floats) -> Floats:
        if number == 0:
            return _bilinear(self._page, x, y, self._table)
        return _remapped(self._smaller[number - 1], x, y)


def linear_table(kind: np.dtype[Any]) -> Floats:
    """Linear light, 0..1, of the sRGB-encoded values of uint8 or uint16."""
    top = np.iinfo(kind).max
    return linear_from_srgb(np.arange(top + 1) / top).astype(np.float32)


def _remapped(image: NDArray[np.uint16], x: Floats, y: Floats) -> Floats:
    """(n, 3) values, 0..1, at x, y (n,), parts of the image's width and height, linearly
    interpolated to a 32nd of a texel; clamped at the border.
    """
    maps = np.zeros((2, -(-len(x) // ROW) * ROW), np.float32)
    for at, place, side in zip(maps, (x, y), image.shape[1::-1], strict=True):
        at[: len(x)] = place * np.float32(side) - np.float32(0.5)
    column, row = maps.reshape(2, -1, ROW)
    found = cv2.remap(image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return found.reshape(-1, 3)[: len(x)] * (1 / WHITE)


def _bilinear(page: NDArray[Any], x: Floats, y: Floats, table: NDArray[np.uint16]) -> Floats:
    """The same of a page that is encoded: `table` has the linear light of its values."""
    height, width = page.shape[:2]
    column = np.clip(x * width - np.float32(0.5), 0, width - 1)
    row = np.clip(y * height - np.float32(0.5), 0, height - 1)
    left, top = column.astype(np.intp), row.astype(np.intp)
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    fx, fy = (column - left)[:, None], (row - top)[:, None]
    upper = (1 - fx) * table[page[top, left]] + fx * table[page[top, right]]
    lower = (1 - fx) * table[page[below, left]] + fx * table[page[below, right]]
    out: Floats = ((1 - fy) * upper + fy * lower) / WHITE
    return out.astype(np.float32, copy=False)
