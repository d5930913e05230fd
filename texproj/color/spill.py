"""Samples of all photos on disk, by chunk of the surface: one decode per photo, any estimator,
and memory that does not know how many photos there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from texproj.color.points import Floats
from texproj.color.sample import WEIGHT_ONE, Samples
from texproj.color.scratch import Scratch
from texproj.color.view import WHITE


@dataclass(frozen=True)
class _Record:
    photo: int
    start: int
    count: int


@dataclass(frozen=True, eq=False)
class Stack:
    """What the photos say about one chunk of n points.

    photos: (p,) numbers of the photos that see some of it; rgb: (p, 3, n) float32 linear light,
    0 where unseen; weight: (p, n) float32, 0 where unseen.
    """

    photos: NDArray[np.intp]
    rgb: Floats
    weight: Floats


class Spill:
    """The samples of photos in a scratch file, chunk by chunk.

    8 bytes per sample and one bit per point of a chunk that a photo sees any of.
    """

    def __init__(self, sizes: list[int], scratch: Scratch) -> None:
        """`sizes`: points of each chunk."""
        self.sizes = sizes
        self._scratch = scratch
        self._records: list[list[_Record]] = [[] for _ in sizes]
        self._lock = Lock()

    def add(self, photo: int, chunk: int, samples: Samples) -> None:
        """Keep what `photo` says about `chunk`."""
        bits = np.packbits(samples.seen)
        start = self._scratch.append(bits.tobytes(), samples.packed.data.cast("B"))
        with self._lock:
            self._records[chunk].append(_Record(photo, start, len(samples.packed)))

    def read(self, chunk: int) -> Stack:
        """Everything about `chunk`, densely."""
        records = sorted(self._records[chunk], key=lambda record: record.photo)
        rgb = np.zeros((len(records), 3, self.sizes[chunk]), np.float32)
        weight = np.zeros((len(records), self.sizes[chunk]), np.float32)
        for row, record in enumerate(records):
            values = self._load(record, self.sizes[chunk]).T
            np.multiply(values[:3], np.float32(1 / WHITE), out=rgb[row])
            np.multiply(values[3], np.float32(1 / WEIGHT_ONE), out=weight[row])
        return Stack(np.array([record.photo for record in records], np.intp), rgb, weight)

    def _load(self, record: _Record, points: int) -> NDArray[np.uint16]:
        """(n, 4) values of a record, 0 where unseen."""
        bits = -(-points // 8)
        data = self._scratch.read(record.start, bits + 8 * record.count)
        packed = np.frombuffer(data, np.uint16, 4 * record.count, bits).reshape(-1, 4)
        if record.count == points:
            return packed
        dense = np.zeros((points, 4), np.uint16)
        seen = np.unpackbits(np.frombuffer(data, np.uint8, bits), count=points).view(bool)
        dense.view(np.uint64)[seen, 0] = packed.copy().view(np.uint64)[:, 0]
        return dense
