"""Photos that need no other are searched beside each other, one on each processor.

Each photo's search reads its own files and the mesh alone, so that what comes of it is the same
as one after the other, to the last bit.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, TimeoutError
from contextlib import contextmanager
from functools import partial
from typing import Any

from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.bench import Workbench
from texproj.stages.methods import Job, Search

FEWEST = 4
"""Photos from which processes of their own are worth starting: one loads programs and mesh in the
time in which a photo is searched."""
LISTEN_S = 0.25
"""Seconds between two chances to stop the work."""
BYTES_PER_FACE = 400
"""Memory that a process needs for each face of the mesh, with its tree of rays and its copies."""
BYTES_PER_PROCESS = 400 << 20
"""Memory that a process needs for itself and a photo."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Where libraries of numerics read how many processors they may take."""

Searching = Callable[[Job], Search]


@contextmanager
def searched_beside(
    bench: Workbench, jobs: Sequence[Job], search: Searching, tell: Callable[[str], None]
) -> Iterator[Searching]:
    """Within this block, what `search` finds for each of `jobs`, waited for where it is not yet
    there; `search` itself where one processor does it as fast.

    search: a function of a module, or a partial one, that asks nothing of a job's neighbors.
    tell: called with the name of the photo that is waited for, several times a second; it may
    raise to stop the work.
    """
    workers = min(len(jobs), _workers(len(bench.mesh.faces))) if len(jobs) >= FEWEST else 1
    if workers < 2:
        yield search
        return
    from concurrent.futures.process import BrokenProcessPool  # noqa: PLC0415 - slow to load

    from loky import ProcessPoolExecutor  # noqa: PLC0415 - slow to load

    bench.keep_occlusion()
    pool = ProcessPoolExecutor(
        workers,
        initializer=_open,
        initargs=(bench.project, os.getpid()),
        env=_share_of_threads(workers),
    )
    try:
        coming = {job.name: pool.submit(_searched, job.name, job.start, search) for job in jobs}

        def waited_for(job: Job) -> Search:
            if job.name not in coming:
                return search(job)
            try:
                return _result(coming[job.name], partial(tell, job.name))
            except BrokenProcessPool:  # a process ended, for lack of memory mostly
                return search(job)

        yield waited_for
    finally:
        pool.shutdown(wait=True, kill_workers=True)


def _result(coming: Future[Search], listen: Callable[[], None]) -> Search:
    while True:
        listen()
        try:
            return coming.result(LISTEN_S)
        except TimeoutError:
            if coming.done():  # the search itself ran out of time somewhere
                raise


def _workers(faces: int) -> int:
    """How many processes this machine has processors and memory for."""
    from loky import cpu_count  # noqa: PLC0415 - slow to load
    from psutil import virtual_memory  # noqa: PLC0415 - slow to load

    each = BYTES_PER_PROCESS + BYTES_PER_FACE * faces
    return min(cpu_count(), virtual_memory().available // each)


def _share_of_threads(workers: int) -> dict[str, Any]:
    """Each process gets its share of the processors; LP_NUM_THREADS are those of Mesa's software
    renderer, beside the one that asks for the picture.
    """
    from loky import cpu_count  # noqa: PLC0415 - slow to load

    share = max(1, cpu_count() // workers)
    return {**dict.fromkeys(THREADS, share), "LP_NUM_THREADS": share - 1}


# --- in a process of its own

_BENCHES: list[Workbench] = []
"""The workbench of this process, once it is open."""


def _open(project: Project, parent: int) -> None:
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    _BENCHES[:] = [Workbench(project)]


def _end_with(parent: int) -> None:
    """End this process soon after the one that started it, however that ended."""
    while os.getppid() == parent:
        time.sleep(LISTEN_S)
    os._exit(1)


def _searched(name: str, start: CameraRecord | None, search: Searching) -> Search:
    return search(Job(_BENCHES[0], name, start, {}))
