"""A project as workers open it: once for all tasks of a run."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from texproj.errors import InputError
from texproj.project import Project
from texproj.resources.cluster import Cluster, ClusterError
from texproj.resources.workers import Pending, WorkerLostError, Workers, processes, processes_here
from texproj.stages.bench import Crew, Workbench
from texproj.stages.copies import Copies, end, in_use
from texproj.version import __version__

T = TypeVar("T")

FEWEST = 4
"""Tasks from which processes of their own are worth starting: one loads programs and mesh in the
time in which a photo is searched."""


@dataclass(frozen=True)
class Site:
    """A project, as it is sent to workers. copied: whether a copy of its files is there in place of
    its folder; run: another one for each run, so that nothing that was read for an earlier one is
    used again.
    """

    project: Project
    copied: bool = False
    run: str = field(default_factory=lambda: uuid.uuid4().hex)

    @classmethod
    def of(cls, project: Project) -> Site:
        """Root and settings alone; all else a worker reads itself."""
        return cls(Project(project.root.resolve(), project.settings))


@dataclass(frozen=True, eq=False)
class SiteCrew:
    """As `Crew` has it. copies: of the project's files, where workers do not see its folder."""

    workers: Workers
    site: Site
    copies: Copies | None = None

    @property
    def count(self) -> int:
        return self.workers.count

    def submit(self, work: Callable[..., T], *args: Any) -> Pending[T]:
        """Have ``work(bench, *args)`` run; a function of a module, or a partial one."""
        return self.workers.submit(_at_the_bench, self.site, work, *args)

    def bring(self, *places: Path) -> None:
        if self.copies is not None:
            self.copies.bring(*places)


@contextmanager
def crew_of(cluster: Cluster, project: Project) -> Iterator[Crew]:
    """The workers of a cluster within this block; afterwards they let go of the project.

    Where one does not see the project folder, all work on copies of its files. Raises InputError
    where a worker has another version of texproj, or no room for a copy.
    """
    site = Site.of(project)
    try:
        there = cluster.everywhere(_looked_at, site.project.root)
    except WorkerLostError:
        raise ClusterError(
            f"workers of {cluster.address} end all the time; see their logs"
        ) from None
    for worker, (version, _) in there.items():
        if version != __version__:
            raise InputError(
                f"the worker at {worker} has texproj {version}, this is {__version__}; install the"
                " same version everywhere"
            )
    known = cluster.on(there)
    try:
        if all(sees for _, sees in there.values()):
            yield SiteCrew(known, site)
        else:
            yield _crew_of_copies(known, replace(site, copied=True))
    finally:
        cluster.after_tasks(partial(leave, site.run))


def _crew_of_copies(cluster: Cluster, site: Site) -> SiteCrew:
    copies = Copies.begun(cluster, site.project, site.run)
    copies.bring_inputs()
    return SiteCrew(cluster, site, copies)


class Hands:
    """Whoever works beside this process: the cluster that was asked for, or else processes of this
    machine, which are begun when they are first worth it. A context manager that ends them.
    """

    def __init__(self, bench: Workbench) -> None:
        self._bench = bench
        self._open = ExitStack()
        self._here: Crew | None = None

    def __enter__(self) -> Hands:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open.__exit__(kind, error, trace)

    def crew_for(self, tasks: int) -> Crew | None:
        """Who does so many tasks that take seconds each; None: this process alone."""
        if self._bench.crew is not None:
            return self._bench.crew
        if self._here is None and tasks >= FEWEST:
            count = min(tasks, processes_here(len(self._bench.mesh.faces)))
            if count > 1:
                workers = self._open.enter_context(processes(count))
                self._here = SiteCrew(workers, Site.of(self._bench.project))
        return self._here


# --- in a worker

_OPEN: dict[str, Workbench] = {}
"""The workbench of this process by the run, once it is open."""


def _looked_at(root: Path) -> tuple[str, bool]:
    """The version here, and whether the folder is seen."""
    return __version__, root.is_dir()


def _at_the_bench(site: Site, work: Callable[..., T], *args: Any) -> T:
    return work(bench_at(site), *args)


def bench_at(site: Site) -> Workbench:
    """The workbench of this process for a project; that of another run is closed."""
    root = in_use(site.run) if site.copied else site.project.root
    if site.run not in _OPEN:
        close()
        _OPEN[site.run] = Workbench(Project(root, site.project.settings))
    return _OPEN[site.run]


def leave(run: str) -> None:
    """Let go of what is open here, and of the copy of a project."""
    close()
    end(run)


def close() -> None:
    """Let go of what is open here."""
    while _OPEN:
        _, bench = _OPEN.popitem()
        bench.__exit__(None, None, None)
