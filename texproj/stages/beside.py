"""Photos that need no other are searched beside each other, by as many workers as there are.

Each photo's search reads its own files and the mesh alone, so that what comes of it is the same
as one after the other, to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from texproj.records import CameraRecord
from texproj.resources.workers import WorkerLostError
from texproj.stages.bench import Workbench
from texproj.stages.methods import Job, Search
from texproj.stages.occlusion_tasks import have_occlusion
from texproj.stages.sites import Hands

Searching = Callable[[Job], Search]
OCCLUSION = "ambient occlusion of the mesh"


def searched_beside(
    bench: Workbench,
    hands: Hands,
    jobs: Sequence[Job],
    search: Searching,
    tell: Callable[[str], None],
) -> Searching:
    """What `search` finds for each of `jobs`, waited for where it is not yet there, as long as the
    hands are there; `search` itself where one processor does it as fast.

    search: a function of a module, or a partial one, that asks nothing of a job's neighbors.
    tell: called with what is waited for, the name of a photo mostly, several times a second; it may
    raise to stop the work.
    """
    crew = hands.crew_for(len(jobs)) if jobs else None
    if crew is None:
        return search
    have_occlusion(bench, crew, partial(tell, OCCLUSION))
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

    return waited_for


def _searched(bench: Workbench, name: str, start: CameraRecord | None, search: Searching) -> Search:
    return search(Job(bench, name, start, {}))
