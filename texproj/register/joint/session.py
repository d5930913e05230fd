"""What the joint refinement works on: the photos at reduced size, seen through the mesh."""

from __future__ import annotations

import pickle
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeVar

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.photo import Photo
from texproj.render import Render
from texproj.resources.scratch import Scratch

Cameras = tuple[Camera, ...]
LoadPhoto = Callable[[int, int], Photo]
"""``load_photo(number, longest)``: the photo with its longer side reduced to `longest`."""

ANCHOR_POINTS = 24

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class Kept(OrderedDict[K, V]):
    """The values last asked for, at most `limit` of them."""

    def __init__(self, limit: int) -> None:
        super().__init__()
        self._limit = limit

    def fetch(self, key: K, make: Callable[[], V]) -> V:
        """The value of `key`, made if it is not there."""
        if key not in self:
            self[key] = make()
            if len(self) > self._limit:
                self.popitem(last=False)
        self.move_to_end(key)
        return self[key]


class OnDisk(Generic[K, V]):
    """Values that are made once and then lie on disk, the last `limit` also in memory."""

    def __init__(self, limit: int) -> None:
        self._scratch, self._kept = Scratch(), Kept[K, V](limit)
        self._places: dict[K, tuple[int, int]] = {}
        weakref.finalize(self, self._scratch.close)

    def fetch(self, key: K, make: Callable[[], V]) -> V:
        """The value of `key`, made if it was never made."""
        return self._kept.fetch(key, lambda: self._read(key, make))

    def _read(self, key: K, make: Callable[[], V]) -> V:
        if key in self._places:
            value: V = pickle.loads(self._scratch.read(*self._places[key]))
            return value
        value = make()
        data = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
        self._places[key] = self._scratch.append(data), len(data)
        return value


def anchor_points(cameras: Sequence[Camera], render: Render) -> list[Doubles]:
    """For each camera (n, 3) world points of the surface, spread over its picture."""
    return [_spread_points(camera.scaled(256 / camera.width), render) for camera in cameras]


def _spread_points(camera: Camera, render: Render) -> Doubles:
    images = render(camera)
    row, column = np.nonzero(np.isfinite(images.require("depth")))
    if not len(row):
        return np.zeros((0, 3))
    order = np.random.default_rng(0).permutation(len(row))[:ANCHOR_POINTS]
    return images.points(camera, row[order], column[order])
