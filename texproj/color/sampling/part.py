"""What one photo says of the whole surface, as it travels from where it was found out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.points.source import PointSource
from texproj.color.sampling.sample import Samples
from texproj.options import ColorOptions


@dataclass(frozen=True)
class Unusable:
    """A photo that cannot be used, and why, in one sentence."""

    name: str
    reason: str


@dataclass(frozen=True, eq=False)
class PackedSamples:
    """`Samples` of a chunk with a bit for each of its points. size: points; seen: packed."""

    chunk: int
    size: int
    seen: NDArray[np.uint8]
    packed: NDArray[np.uint16]
    around: NDArray[np.uint16] | None

    @classmethod
    def of(cls, chunk: int, samples: Samples) -> PackedSamples:
        """The samples of a chunk."""
        seen = np.packbits(samples.seen)
        return cls(chunk, len(samples.seen), seen, samples.packed, samples.around)

    def samples(self) -> Samples:
        """As they were."""
        seen = np.unpackbits(self.seen, count=self.size).view(np.bool_)
        return Samples(seen, self.packed, self.around)


@dataclass(frozen=True, eq=False)
class PhotoPart:
    """samples: of the chunks of which the photo sees any; noted: what an observer keeps of it."""

    samples: Sequence[PackedSamples]
    noted: Any


class Elsewhere(Protocol):
    """Workers that know the photos by their names."""

    def parts(
        self,
        points: PointSource,
        cameras: dict[str, Camera],
        shifts: Sequence[Floats | None],
        options: ColorOptions,
    ) -> Iterator[PhotoPart | Unusable]:
        """What each photo says of all points, one photo after the other. cameras: of the full-size
        photos, by name; shifts: their displacements, see `PhotoView`.
        """
