"""Features and pairs of a block's photos, found by workers that know the project."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from texproj.colmap.messages import Batch, Features, Matched
from texproj.colmap.run import available
from texproj.errors import InputError, RegistrationError
from texproj.register.block.structure_from_motion import LONGEST_PX, picture_of
from texproj.resources.workers import Pending, WorkerLostError, Workers
from texproj.stages.attending import NO_MEMORY
from texproj.stages.bench import Workbench
from texproj.stages.block_fits import load_reduced

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class BlockByCrew:
    """As `Elsewhere` has it."""

    crew: Workers

    @property
    def count(self) -> int:
        return self.crew.count

    def features(self, name: str, key: str) -> Pending[Features]:
        return _Told(self.crew.submit(_features, name, key), InputError(NO_MEMORY))

    def match(self, batch: Batch) -> Pending[Matched]:
        return _Told(self.crew.submit(_matched, batch), MemoryError())


@dataclass(frozen=True, eq=False)
class _Told(Generic[T]):
    """A task, and what is raised where several workers have ended at it: so would this process."""

    pending: Pending[T]
    fatal: Exception

    def result(self, listen: Callable[[], None]) -> T:
        try:
            return self.pending.result(listen)
        except WorkerLostError:
            raise self.fatal from None


# --- in a worker


def _features(bench: Workbench, name: str, key: str) -> Features:
    if not available():
        raise RegistrationError("a worker of the cluster has no COLMAP: pip install pycolmap there")
    from texproj.colmap.work import features_of  # noqa: PLC0415 - loads COLMAP

    return features_of(picture_of(key, load_reduced(bench, name, longest=LONGEST_PX)))


def _matched(_bench: Workbench, batch: Batch) -> Matched:
    from texproj.colmap.work import matched  # noqa: PLC0415 - loads COLMAP

    return matched(batch, threads=1)
