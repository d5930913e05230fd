"""Photos that need no other are searched beside each other, by as many workers as there are.

Each photo's search reads its own files and the mesh alone, so that what comes of it is the same
as one after the other, to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial

from texproj.records import CameraRecord
from texproj.resources.workers import WorkerLostError
from texproj.stages.bench import Workbench
from texproj.stages.methods import Job, Search
from texproj.stages.sites import crew_for

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
    with crew_for(bench, len(jobs)) as crew:
        if crew is None or not jobs:
            yield search
            return
        bench.keep_occlusion()
        coming = {job.name: crew.submit(_searched, job.name, job.start, search) for job in jobs}

        def waited_for(job: Job) -> Search:
            if job.name not in coming:
                return search(job)
            try:
                return coming[job.name].result(partial(tell, job.name))
            except WorkerLostError:
                if crew is bench.crew:  # several workers have ended at it: so would this one
                    raise MemoryError from None
                return search(job)

        yield waited_for


def _searched(bench: Workbench, name: str, start: CameraRecord | None, search: Searching) -> Search:
    return search(Job(bench, name, start, {}))
