"""Samples of all photos on disk, by chunk of the surface: one decode per photo, any estimator,
and memory that does not know how many photos there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.sampling.light_around import AROUND_ONE
from texproj.color.sampling.sample import WEIGHT_ONE, Samples
from texproj.color.sampling.view import WHITE
from texproj.resources.scratch import Scratch

Packed = NDArray[np.uint16]

MOST_SAMPLES = 1 << 20
"""Samples of one chunk that are in memory at once: 24 MB."""

FEWEST_POINTS = 1 << 11


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


class SampleStore:
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

    def pieces(self, chunk: int) -> list[slice]:
        """Consecutive parts of a chunk of which no more than `MOST_SAMPLES` are known, or as few
        points as `FEWEST_POINTS`.
        """
        size = max(MOST_SAMPLES // max(len(self._records[chunk]), 1), FEWEST_POINTS)
        count = self.sizes[chunk]
        return [slice(at, min(at + size, count)) for at in range(0, count, size)]

    def read(self, chunk: int, rows: slice | None = None) -> Stack:
        """Everything about `chunk`, or about some of its points, densely."""
        rows = rows or slice(0, self.sizes[chunk])
        records = sorted(self._records[chunk], key=lambda record: record.photo)
        photos = np.array([record.photo for record in records], np.intp)
        count = rows.stop - rows.start
        rgb = np.empty((len(records), 3, count), np.float32)
        weight = np.empty((len(records), count), np.float32)
        around = np.empty_like(weight) if records and records[0].around else None
        for row, record in enumerate(records):
            packed, ratio = self._load(record, self.sizes[chunk], rows)
            for channel, out in enumerate(rgb[row]):
                np.multiply(packed[:, channel], np.float32(1 / WHITE), out=out)
            np.multiply(packed[:, 3], np.float32(1 / WEIGHT_ONE), out=weight[row])
            if around is not None and ratio is not None:
                np.multiply(ratio, np.float32(1 / AROUND_ONE), out=around[row])
        return Stack(photos, rgb, weight, around)

    def _load(self, record: _Record, points: int, rows: slice) -> tuple[Packed, Packed | None]:
        """(n, 4) values of a record and (n,) light around the points, 0 where unseen."""
        bits = np.frombuffer(self._scratch.read(record.start, -(-points // 8)), np.uint8)
        seen = np.unpackbits(bits, count=points).view(bool)
        first, seen = int(np.count_nonzero(seen[: rows.start])), seen[rows]
        count, start = int(np.count_nonzero(seen)), record.start + len(bits)
        packed = _spread(self._part(start, 8, first, count).view(np.uint64), seen)
        ratio = None
        if record.around:
            ratio = _spread(self._part(start + 8 * record.count, 2, first, count), seen)
        return packed.view(np.uint16).reshape(-1, 4), ratio

    def _part(self, start: int, size: int, first: int, count: int) -> Packed:
        data = self._scratch.read(start + size * first, size * count)
        return np.frombuffer(data, np.uint16)


def _spread(values: NDArray[Any], seen: NDArray[np.bool_]) -> NDArray[Any]:
    """The values where something is seen, 0 elsewhere."""
    if len(values) == len(seen):
        return values
    out = np.zeros(len(seen), values.dtype)
    out[seen] = values
    return out
