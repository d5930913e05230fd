"""A project as workers open it: once for all tasks of a run."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from texproj.errors import InputError
from texproj.project import Project
from texproj.resources.cluster import Cluster
from texproj.resources.workers import Pending, Workers, processes, processes_here
from texproj.stages.bench import Workbench
from texproj.version import __version__

T = TypeVar("T")

FEWEST = 4
"""Tasks from which processes of their own are worth starting: one loads programs and mesh in the
time in which a photo is searched."""


@dataclass(frozen=True)
class Site:
    """A project, as it is sent to workers. run: another one for each run, so that nothing that was
    read for an earlier one is used again.
    """

    project: Project
    run: str = field(default_factory=lambda: uuid.uuid4().hex)

    @classmethod
    def of(cls, project: Project) -> Site:
        """Root and settings alone; all else a worker reads itself."""
        return cls(Project(project.root.resolve(), project.settings))


@dataclass(frozen=True, eq=False)
class Crew:
    """Workers that know a project: each task gets its workbench there before all else."""

    workers: Workers
    site: Site

    @property
    def count(self) -> int:
        return self.workers.count

    def submit(self, work: Callable[..., T], *args: Any) -> Pending[T]:
        """Have ``work(bench, *args)`` run; a function of a module, or a partial one."""
        return self.workers.submit(_at_the_bench, self.site, work, *args)


@contextmanager
def crew_of(cluster: Cluster, project: Project) -> Iterator[Crew]:
    """The workers of a cluster within this block; afterwards they let go of the project.

    Raises InputError where one cannot see the folder, or has another version of texproj.
    """
    site = Site.of(project)
    for worker, version in cluster.everywhere(_looked_at, site.project.root).items():
        if version is None:
            raise InputError(
                f"the worker at {worker} does not see {site.project.root}: the project folder has"
                " to be on storage that all workers share, under the same path"
            )
        if version != __version__:
            raise InputError(
                f"the worker at {worker} has texproj {version}, this is {__version__}; install the"
                " same version everywhere"
            )
    try:
        yield Crew(cluster, site)
    finally:
        cluster.after_tasks(close)


@contextmanager
def crew_for(bench: Workbench, tasks: int) -> Iterator[Workers | None]:
    """Whoever does so many tasks of a project that take seconds each: the cluster that was asked
    for, or processes of this machine where that is faster, or None: this process alone.
    """
    if bench.crew is not None:
        yield bench.crew
        return
    count = min(tasks, processes_here(len(bench.mesh.faces))) if tasks >= FEWEST else 1
    if count < 2:
        yield None
        return
    with processes(count) as workers:
        yield Crew(workers, Site.of(bench.project))


# --- in a worker

_OPEN: dict[str, Workbench] = {}
"""The workbench of this process by the run, once it is open."""


def _looked_at(root: Path) -> str | None:
    """The version here; None where the folder is not."""
    return __version__ if root.is_dir() else None


def _at_the_bench(site: Site, work: Callable[..., T], *args: Any) -> T:
    return work(bench_at(site), *args)


def bench_at(site: Site) -> Workbench:
    """The workbench of this process for a project; that of another run is closed."""
    if site.run not in _OPEN:
        close()
        _OPEN[site.run] = Workbench(site.project)
    return _OPEN[site.run]


def close() -> None:
    """Let go of what is open here."""
    while _OPEN:
        _, bench = _OPEN.popitem()
        bench.__exit__(None, None, None)
