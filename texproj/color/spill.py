"""Samples of all photos on disk, by chunk of the surface: one decode per photo, any estimator,
and memory that does not know how many photos there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from texproj.color.bands import AROUND_ONE
from texproj.color.points import Floats
from texproj.color.sample import WEIGHT_ONE, Samples
from texproj.color.scratch import Scratch
from texproj.color.view import WHITE


@dataclass(frozen=True)
class _Record:
    photo: int
    start: int
    count: int
    around: bool


@dataclass(frozen=True, eq=False)
class Stack:
    """What the photos say about one chunk of n points.

    photos: (p,) numbers of the photos that see some of it; rgb: (p, 3, n) float32 linear light,
    0 where unseen; weight: (p, n) float32, 0 where unseen; around: (p, n) float32 light around the
    point against its own, as square roots, if it was sampled; trust: (p, n) float32 the part of
    the weight that says how sharp the photo is there, None = 1.
    """

    photos: NDArray[np.intp]
    rgb: Floats
    weight: Floats
    around: Floats | None = None
    trust: Floats | None = None


class Spill:
    """The samples of photos in a scratch file, chunk by chunk.

    8 bytes per sample (10 with the light around it) and one bit per point of a chunk that a photo
    sees any of.
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
        around = b"" if samples.around is None else samples.around.tobytes()
        start = self._scratch.append(bits.tobytes(), samples.packed.data.cast("B"), around)
        record = _Record(photo, start, len(samples.packed), samples.around is not None)
        with self._lock:
            self._records[chunk].append(record)

    def read(self, chunk: int) -> Stack:
        """Everything about `chunk`, densely."""
        records = sorted(self._records[chunk], key=lambda record: record.photo)
        photos = np.array([record.photo for record in records], np.intp)
        rgb = np.zeros((len(records), 3, self.sizes[chunk]), np.float32)
        weight = np.zeros((len(records), self.sizes[chunk]), np.float32)
        around = np.zeros_like(weight) if records and records[0].around else None
        for row, record in enumerate(records):
            values, ratio = self._load(record, self.sizes[chunk])
            np.multiply(values.T[:3], np.float32(1 / WHITE), out=rgb[row])
            np.multiply(values.T[3], np.float32(1 / WEIGHT_ONE), out=weight[row])
            if around is not None and ratio is not None:
                np.multiply(ratio, np.float32(1 / AROUND_ONE), out=around[row])
        return Stack(photos, rgb, weight, around)

    def _load(
        self, record: _Record, points: int
    ) -> tuple[NDArray[np.uint16], NDArray[np.uint16] | None]:
        """(n, 4) values of a record and (n,) light around the points, 0 where unseen."""
        bits, count = -(-points // 8), record.count
        data = self._scratch.read(record.start, bits + (10 if record.around else 8) * count)
        packed = np.frombuffer(data, np.uint16, 4 * count, bits).reshape(-1, 4)
        ratio = None
        if record.around:
            ratio = np.frombuffer(data, np.uint16, count, bits + 8 * count)
        if count == points:
            return packed, ratio
        seen = np.unpackbits(np.frombuffer(data, np.uint8, bits), count=points).view(bool)
        dense = np.zeros((points, 4), np.uint16)
        dense.view(np.uint64)[seen, 0] = packed.copy().view(np.uint64)[:, 0]
        if ratio is None:
            return dense, None
        full = np.zeros(points, np.uint16)
        full[seen] = ratio
        return dense, full
