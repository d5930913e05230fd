"""The part of a photo that is worth looking at, and cameras for it at any size."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera, Intrinsics
from texproj.photo import Photo


@dataclass(frozen=True)
class Window:
    """A rectangle of a photo: corner x, y and size in pixels of the full-size photo, whose own
    size is `full_width` x `full_height`.
    """

    x: float
    y: float
    width: float
    height: float
    full_width: int
    full_height: int

    @classmethod
    def whole(cls, width: int, height: int) -> Window:
        return cls(0, 0, width, height, width, height)

    @classmethod
    def around(cls, seen: NDArray[np.bool_], margin: float, width: int, height: int) -> Window:
        """What is seen, (h, w) bool in any size, with `margin` of the photo's longer side."""
        y, x = np.nonzero(seen)
        h, w = seen.shape
        pad = margin * max(width, height)
        left, right = _span(x * width / w, (x + 1) * width / w, pad, width)
        top, bottom = _span(y * height / h, (y + 1) * height / h, pad, height)
        return cls(left, top, right - left, bottom - top, width, height)

    @property
    def mirrored(self) -> Window:
        """The same part of the photo with left and right exchanged."""
        return replace(self, x=self.full_width - self.x - self.width)

    def cut(self, photo: Photo) -> tuple[Window, Photo]:
        """The photo's pixels inside, and the window of exactly those pixels."""
        sx, sy = photo.width / self.full_width, photo.height / self.full_height
        left, top = int(self.x * sx), int(self.y * sy)
        right = min(photo.width, int(np.ceil((self.x + self.width) * sx)))
        bottom = min(photo.height, int(np.ceil((self.y + self.height) * sy)))
        area = (slice(top, bottom), slice(left, right))
        mask = None if photo.mask is None else photo.mask[area]
        exact = replace(
            self, x=left / sx, y=top / sy, width=(right - left) / sx, height=(bottom - top) / sy
        )
        return exact, replace(photo, pixels=photo.pixels[area], mask=mask)

    def camera_of(self, full: Camera, width: int, height: int) -> Camera:
        """The camera of the window, resampled to width x height, for one of the whole photo."""
        k = full.intrinsics.resized(self.full_width, self.full_height)
        moved = replace(k, cx=k.cx - self.x, cy=k.cy - self.y)
        return replace(full, intrinsics=_resampled(moved, self.width, self.height, width, height))

    def full_camera(self, part: Camera) -> Camera:
        """The camera of the whole full-size photo for one of the resampled window."""
        k = part.intrinsics
        size = (self.full_width, self.full_height)
        large = _resampled(k, k.width, k.height, self.width, self.height)
        whole = replace(
            large, width=size[0], height=size[1], cx=large.cx + self.x, cy=large.cy + self.y
        )
        return replace(part, intrinsics=whole)


def _span(low: Doubles, high: Doubles, pad: float, limit: int) -> tuple[float, float]:
    return max(0.0, float(low.min()) - pad), min(float(limit), float(high.max()) + pad)


def _resampled(k: Intrinsics, from_w: float, from_h: float, to_w: float, to_h: float) -> Intrinsics:
    sx, sy = to_w / from_w, to_h / from_h
    size = (max(1, round(to_w)), max(1, round(to_h)))
    return replace(
        k, width=size[0], height=size[1], fx=k.fx * sx, fy=k.fy * sy, cx=k.cx * sx, cy=k.cy * sy
    )
