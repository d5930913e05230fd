"""What the process that runs COLMAP is told, and what it tells: values that can be pickled."""

from __future__ import annotations

import pickle
import struct
from dataclasses import dataclass
from typing import IO, Any

from texproj.arrays import Bytes, Doubles, Floats, Index, Ints
from texproj.camera import Intrinsics


@dataclass(frozen=True)
class Lens:
    """What is believed of the lens that some photos share, at their reduced size.

    intrinsics: a calibrated lens, which stays as it is; None: the focal length is solved, and one
    coefficient of radial distortion, from `focal_px`, or from a usual lens where that is None too,
    and from `k1`.
    """

    width: int
    height: int
    focal_px: float | None = None
    intrinsics: Intrinsics | None = None
    k1: float = 0.0


@dataclass(frozen=True)
class Task:
    """database: path of the file that keeps features and matches from run to run; scratch: an empty
    folder; keys: per photo, another one for other content; lens_of: per photo, number of its lens;
    ahead: batches of pairs that may be on their way to whoever matches them elsewhere, 0: none is.
    """

    database: str
    scratch: str
    keys: tuple[str, ...]
    lenses: tuple[Lens, ...]
    lens_of: tuple[int, ...]
    threads: int
    ahead: int = 0


@dataclass(frozen=True, eq=False)
class Picture:
    """A photo whose features are wanted. gray: (h, w) uint8; mask: the same, 0 = no features."""

    key: str
    gray: Bytes
    mask: Bytes | None


@dataclass(frozen=True, eq=False)
class Features:
    """What was found in a picture. points: (n, 4 or 6) float32 keypoints; descriptors: COLMAP's
    own, pickled, since others need not know them.
    """

    key: str
    points: Floats
    descriptors: bytes


@dataclass(frozen=True)
class Complete:
    """There are no more pictures."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Pairs to be matched elsewhere. features: of the photos in question, in the order of the
    database; lenses, lens_of: as in `Task`, of these photos; pairs: (a, b) keys.
    """

    features: tuple[Features, ...]
    lenses: tuple[Lens, ...]
    lens_of: tuple[int, ...]
    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Awaited:
    """The oldest batch is waited for."""


@dataclass(frozen=True, eq=False)
class Match:
    """Of a pair: (n, 2) uint32 rows of keypoints that look alike, and COLMAP's own verdict on their
    geometry, pickled.
    """

    pair: tuple[str, str]
    rows: Ints
    geometry: bytes


@dataclass(frozen=True, eq=False)
class Matched:
    """What came of a batch."""

    matches: tuple[Match, ...]


@dataclass(frozen=True)
class Wanted:
    """The photos whose features the database lacks."""

    keys: tuple[str, ...]


@dataclass(frozen=True)
class Told:
    """How far a step is."""

    what: str
    done: int
    total: int


@dataclass(frozen=True, eq=False)
class Model:
    """One connected part, in pixels of the reduced photos.

    photos: (p,) numbers; lens_params: (f, cx, cy, k1) of each, None where the lens is a calibrated
    one; R: (p, 3, 3), t: (p, 3) cam_from_block; points: (n, 3), error_px: (n,); of the m
    observations track: (m,) row of the point, seer: (m,) row in `photos`, xy_px: (m, 2).
    """

    photos: Ints
    lens_params: tuple[tuple[float, float, float, float] | None, ...]
    R: Doubles
    t: Doubles
    points: Doubles
    error_px: Doubles
    track: Index
    seer: Index
    xy_px: Floats


@dataclass(frozen=True, eq=False)
class Result:
    """The parts, the largest first; pairs: (k, 2) photos; matches: (k,) verified points of each."""

    models: tuple[Model, ...]
    pairs: Ints
    matches: Ints


@dataclass(frozen=True)
class Failed:
    """The process cannot go on. sentence: why."""

    sentence: str


def send(stream: IO[bytes], message: Any) -> None:
    """Write a message and what tells its length."""
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    stream.write(struct.pack("<Q", len(data)))
    stream.write(data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """The next message; None where the stream ends."""
    head = stream.read(8)
    if len(head) < 8:
        return None
    size = struct.unpack("<Q", head)[0]
    data = stream.read(size)
    return pickle.loads(data) if len(data) == size else None
