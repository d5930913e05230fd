"""Photos as the joint refinement compares them: luma, reduced, kept small."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.photo import Photo
from texproj.register.joint.session import Kept, LoadPhoto
from texproj.resources.scratch import Scratch

WHITE = 65535
"""Luma is kept in 16 bits: half of float32, and finer than any photo."""
KEPT = 32
"""Pictures that stay in memory, 1 to 6 MB each: of 16 photos at two sizes. Reading one back from
disk takes 2 ms, decoding it again 80."""


@dataclass(frozen=True, eq=False)
class GrayPhoto:
    """pixels: (h, w) uint16 luma, sRGB-encoded, 65535 = white; mask: (h, w) uint8 or None,
    0 = do not use.
    """

    pixels: NDArray[np.uint16]
    mask: NDArray[np.uint8] | None

    @classmethod
    def of(cls, photo: Photo) -> GrayPhoto:
        luma = np.clip(photo.gray(), 0, 1) * np.float32(WHITE) + np.float32(0.5)
        return cls(luma.astype(np.uint16), photo.mask)

    @property
    def width(self) -> int:
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        return int(self.pixels.shape[0])

    def luma(self) -> Floats:
        """(h, w) float32 in 0..1."""
        return self.pixels * np.float32(1 / WHITE)

    def at(self, places: Floats) -> Floats:
        """(n, m) float32 luma in 0..1 at (n, m, 2) places as OpenCV counts them."""
        luma: Floats = cv2.remap(
            self.pixels, places, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return luma * np.float32(1 / WHITE)

    def reduced(self, longest_px: int) -> GrayPhoto:
        """With the longer side reduced to `longest_px`, itself if it is smaller."""
        factor = longest_px / max(self.width, self.height)
        if factor >= 1:
            return self
        size = (max(1, round(self.width * factor)), max(1, round(self.height * factor)))
        mask = self.mask
        if mask is not None:
            mask = cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST_EXACT)
        return GrayPhoto(cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA), mask)


@dataclass(frozen=True)
class _Stored:
    """Where a picture lies; shape: (h, w)."""

    start: int
    shape: tuple[int, int]
    masked: bool


class GrayPhotos:
    """Photos at the sizes that are asked for: each is decoded once and then kept on disk, the last
    ones in memory.
    """

    def __init__(self, load_photo: LoadPhoto, largest_px: int) -> None:
        self._load, self._largest, self._scratch = load_photo, largest_px, Scratch()
        self._stored: dict[tuple[int, int], _Stored] = {}
        self._kept: Kept[tuple[int, int], GrayPhoto] = Kept(KEPT)
        weakref.finalize(self, self._scratch.close)

    def at(self, k: int, longest: int) -> GrayPhoto:
        """Photo k with its longer side reduced to `longest`."""
        return self._kept.fetch((k, longest), lambda: self._read(k, longest))

    def _read(self, k: int, longest: int) -> GrayPhoto:
        if (k, longest) in self._stored:
            return self._taken(self._stored[k, longest])
        if longest < self._largest:
            photo = self.at(k, self._largest).reduced(longest)
        else:
            photo = GrayPhoto.of(self._load(k, self._largest))
        self._stored[k, longest] = self._put(photo)
        return photo

    def _put(self, photo: GrayPhoto) -> _Stored:
        parts = [np.ascontiguousarray(photo.pixels).data.cast("B")]
        if photo.mask is not None:
            parts.append(np.ascontiguousarray(photo.mask).data.cast("B"))
        shape = photo.height, photo.width
        return _Stored(self._scratch.append(*parts), shape, photo.mask is not None)

    def _taken(self, at: _Stored) -> GrayPhoto:
        count = at.shape[0] * at.shape[1]
        data = self._scratch.read(at.start, (3 if at.masked else 2) * count)
        mask = np.frombuffer(data, np.uint8, count, 2 * count) if at.masked else None
        return GrayPhoto(
            np.frombuffer(data, np.uint16, count).reshape(at.shape),
            None if mask is None else mask.reshape(at.shape),
        )
