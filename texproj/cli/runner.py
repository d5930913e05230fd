"""How every command runs its stage and tells the outcome, for people or for machines."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from texproj.cli import talk
from texproj.cli.exits import DONE, SOME_FAILED, STOP, UNUSABLE
from texproj.cli.progress import shown_progress
from texproj.cli.shared import tell_ignored
from texproj.project import Project
from texproj.stages.outcomes import Tally
from texproj.stages.progress import Progress

if TYPE_CHECKING:
    from texproj.stages.bench import Workbench

LOG = logging.getLogger("texproj")


class Outcome(Protocol):
    """What a stage has to tell."""

    @property
    def tally(self) -> Tally:
        """How many photos failed."""

    def lines(self) -> Iterable[str]:
        """For people."""

    def as_dict(self) -> dict[str, Any]:
        """For --json."""


def run_stage(
    project: Project,
    json: bool,
    stage: Callable[[Any, Progress], Outcome],
    cluster: str | None = None,
) -> int:
    """Call `stage` with a workbench of the project and the progress; tell what came of it.

    cluster: where its tasks run, if not on this machine alone.
    """
    with _bench(project, cluster) as bench, shown_progress() as progress:

        def show(stage: str, done: int, total: int, item: str) -> None:
            if STOP.is_set():
                raise KeyboardInterrupt
            progress(stage, done, total, item)

        outcome = stage(bench, show)
    for line in outcome.lines():
        LOG.info("%s", line)
    return tell(project, outcome, json)


@contextmanager
def _bench(project: Project, address: str | None) -> Iterator[Workbench]:
    from texproj.stages.bench import Workbench  # noqa: PLC0415

    if address is None:
        with Workbench(project) as bench:
            yield bench
        return
    from texproj.resources.cluster import cluster_at  # noqa: PLC0415
    from texproj.stages.sites import crew_of  # noqa: PLC0415

    with (
        cluster_at(address) as cluster,
        crew_of(cluster, project) as crew,
        Workbench(project, crew) as bench,
    ):
        talk.note(f"{cluster.count} workers at {address}, dashboard: {cluster.dashboard}")
        yield bench


def tell(project: Project, outcome: Outcome, json: bool) -> int:
    """Say what came of a command; returns the exit code."""
    ignored = tell_ignored(project)
    if json:
        talk.say_json(outcome.as_dict() | {"ignored": ignored})
    else:
        for line in outcome.lines():
            talk.say(line)
    return _code(outcome.tally)


def _code(tally: Tally) -> int:
    if tally.unusable:
        talk.complain(tally.unusable)
        return SOME_FAILED if tally.failed else UNUSABLE
    if tally.fault:
        talk.complain(tally.fault)
    if tally.failed:
        talk.complain(
            f"{tally.failed} of {tally.total} photos could not be {tally.verb};"
            f" the reasons are above"
        )
    return SOME_FAILED if tally.failed or tally.fault else DONE
