"""Samples of all photos on disk, by chunk of the surface: one decode per photo, any estimator,
and memory that does not know how many photos there are.
"""

from __future__ import annotations

import os
import tempfile
from threading import Lock
from dataclasses import dataclass
from typing import BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from texproj.color.points import Floats
from texproj.color.sample import Samples
from texproj.color.view import WHITE

WEIGHT_ONE = 65535
"""The 16-bit value of weight 1; a weight above zero is stored as at least 1."""


SURVEYED_CHUNKS = 48
"""Chunks that a survey reads."""


@dataclass(frozen=True)
class _Record:
    photo: int
    offset: int
    count: int
    points: int


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
    """An unnamed temporary file that holds the samples of photos, chunk by chunk.

    8 bytes per sample and one bit per point of a chunk that a photo sees any of. The disk space
    goes back when the spill is closed, even if the process is killed.
    """

    def __init__(self, sizes: list[int]) -> None:
        """`sizes`: points of each chunk."""
        self._sizes = sizes
        self._file = cast("BinaryIO", tempfile.TemporaryFile(prefix="texproj-"))  # noqa: SIM115
        self._records: list[list[_Record]] = [[] for _ in sizes]
        self._end = 0
        self._lock = Lock()

    def __enter__(self) -> Spill:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @property
    def size_bytes(self) -> int:
        """How much has been written."""
        return self._end

    def add(self, photo: int, chunk: int, samples: Samples) -> None:
        """Append what `photo` says about `chunk`."""
        if not len(samples.index):
            return
        seen = np.zeros(self._sizes[chunk], bool)
        seen[samples.index] = True
        packed = np.empty((4, len(samples.index)), np.uint16)
        packed[:3] = samples.rgb.T
        packed[3] = np.maximum(samples.weight * WEIGHT_ONE, 1)
        data = np.packbits(seen).tobytes() + packed.tobytes()
        with self._lock:
            self._records[chunk].append(_Record(photo, self._end, len(samples.index), len(seen)))
            self._end += len(data)
        os.pwrite(self._file.fileno(), data, self._records[chunk][-1].offset)

    def read(self, chunk: int) -> Stack:
        """Everything about `chunk`, densely."""
        records, n = self._records[chunk], self._sizes[chunk]
        rgb = np.zeros((len(records), 3, n), np.float32)
        weight = np.zeros((len(records), n), np.float32)
        for row, record in enumerate(records):
            index, packed = self._load(record)
            for channel in range(3):
                rgb[row, channel, index] = packed[channel] * np.float32(1 / WHITE)
            weight[row, index] = packed[3] * np.float32(1 / WEIGHT_ONE)
        photos = np.array([record.photo for record in records], np.intp)
        return Stack(photos, rgb, weight)

    def survey(self, points: int) -> list[Stack]:
        """About `points` points, spread over a few dozen chunks."""
        used = [chunk for chunk, records in enumerate(self._records) if len(records) > 1]
        chosen = used[:: max(1, len(used) // SURVEYED_CHUNKS)]
        step = max(1, sum(self._sizes[chunk] for chunk in chosen) // points)
        stacks = (self.read(chunk) for chunk in chosen)
        return [
            Stack(s.photos, s.rgb[:, :, ::step].copy(), s.weight[:, ::step].copy()) for s in stacks
        ]

    def _load(self, record: _Record) -> tuple[NDArray[np.intp], NDArray[np.uint16]]:
        bits = -(-record.points // 8)
        data = os.pread(self._file.fileno(), bits + 8 * record.count, record.offset)
        seen = np.unpackbits(np.frombuffer(data, np.uint8, bits), count=record.points)
        packed = np.frombuffer(data, np.uint16, 4 * record.count, bits).reshape(4, -1)
        return np.flatnonzero(seen), packed
