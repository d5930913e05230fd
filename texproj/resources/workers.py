"""Where tasks run beside each other: in processes of this machine, or in those of a cluster."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

LISTEN_S = 0.25
"""Seconds between two chances to stop the work."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Where libraries of numerics read how many processors they may take."""
BYTES_PER_FACE = 400
"""Memory that a process needs for each face of the mesh, with its tree of rays and its copies."""
BYTES_PER_PROCESS = 400 << 20
"""Memory that a process needs for itself and a photo."""


class WorkerLostError(Exception):
    """The process that ran a task has ended, mostly for lack of memory."""


class Pending(Protocol[T_co]):
    """A task on its way."""

    def result(self, listen: Callable[[], None]) -> T_co:
        """What the task gives back or raises. `listen` is called several times a second; it may
        raise to stop the work. Raises WorkerLostError.
        """


class Workers(Protocol):
    """Processes that run tasks."""

    @property
    def count(self) -> int:
        """How many tasks run at once."""

    def submit(self, work: Callable[..., T], *args: Any) -> Pending[T]:
        """Have ``work(*args)`` run; a function of a module, or a partial one."""


@dataclass(frozen=True, eq=False)
class Processes:
    """Processes of this machine, of loky: each loads programs anew and has its own OpenGL."""

    count: int
    _pool: Any

    def submit(self, work: Callable[..., T], *args: Any) -> Pending[T]:
        from concurrent.futures.process import BrokenProcessPool  # noqa: PLC0415 - slow to load

        try:
            return _Process(self._pool.submit(work, *args))
        except BrokenProcessPool as error:  # a process has ended at an earlier task
            return _Lost(error)


@dataclass(frozen=True, eq=False)
class _Process(Generic[T]):
    future: Future[T]

    def result(self, listen: Callable[[], None]) -> T:
        from concurrent.futures.process import BrokenProcessPool  # noqa: PLC0415 - slow to load

        listen()
        while not self.future.done():
            wait([self.future], LISTEN_S)
            listen()
        try:
            return self.future.result()
        except BrokenProcessPool as error:
            raise WorkerLostError from error


@dataclass(frozen=True, eq=False)
class _Lost:
    """A task that nobody took."""

    why: Exception

    def result(self, listen: Callable[[], None]) -> Any:
        listen()
        raise WorkerLostError from self.why


@contextmanager
def processes(count: int) -> Iterator[Processes]:
    """So many processes within this block; they end with it, whatever they are at."""
    from loky import ProcessPoolExecutor  # noqa: PLC0415 - slow to load

    pool = ProcessPoolExecutor(
        count, initializer=_end_with_parent, initargs=(os.getpid(),), env=_share_of_threads(count)
    )
    try:
        yield Processes(count, pool)
    finally:
        pool.shutdown(wait=True, kill_workers=True)


def processes_here(faces: int) -> int:
    """How many processes this machine has processors and memory for. faces: those of the mesh."""
    from loky import cpu_count  # noqa: PLC0415 - slow to load
    from psutil import virtual_memory  # noqa: PLC0415 - slow to load

    each = BYTES_PER_PROCESS + BYTES_PER_FACE * faces
    return min(cpu_count(), virtual_memory().available // each)


def _share_of_threads(count: int) -> dict[str, Any]:
    """Each process gets its share of the processors; LP_NUM_THREADS are those of Mesa's software
    renderer, beside the one that asks for the picture.
    """
    from loky import cpu_count  # noqa: PLC0415 - slow to load

    share = max(1, cpu_count() // count)
    return {**dict.fromkeys(THREADS, share), "LP_NUM_THREADS": share - 1}


def _end_with_parent(parent: int) -> None:
    """In a process of its own: end soon after the one that started it, however that ended."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LISTEN_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
