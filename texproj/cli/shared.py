"""What all commands share: their common parameters, opening a project, the exit code."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from texproj.at_work import at_work
from texproj.cli import talk
from texproj.cli.exits import DONE, SOME_FAILED
from texproj.cli.flags import apply_flags
from texproj.errors import TexprojError, UsageError
from texproj.log import logged
from texproj.project import Project
from texproj.stages.progress import Cancelled

LOG = logging.getLogger("texproj")

Folder = Annotated[Path, Parameter(name="DIR", help="The project folder.", show_default=False)]
Json = Annotated[bool, Parameter(name="--json", negative="", help="Print the outcome as JSON.")]
Verbose = Annotated[
    bool, Parameter(name=["--verbose", "-v"], negative="", help="Tell what happens inside.")
]
Cluster = Annotated[
    str | None,
    Parameter(
        name="--cluster",
        help="Where tasks run: a Dask scheduler, tcp://HOST:8786, or local:4.",
        show_default=False,
    ),
]


def open_project(folder: Path, flags: Any, verbose: bool) -> Project:
    """The project in `folder` with the given flags over its settings; nothing is written."""
    talk.talk_about_details(verbose)
    project = Project.open(folder)
    return project.with_settings(apply_flags(project.settings, flags))


@contextmanager
def project_at_work(folder: Path, flags: Any, verbose: bool, command: str) -> Iterator[Project]:
    """The same for a command that writes: alone on the project, and with its log."""
    project = open_project(folder, flags, verbose)
    with at_work(project.work, command, talk.complain), logged(project.log_folder, command):
        try:
            project.remove_unfinished()
            yield project
        except TexprojError as error:
            LOG.warning("refused: %s", error)
            raise
        except (KeyboardInterrupt, Cancelled):
            LOG.warning("stopped on request")
            raise
        except Exception:
            LOG.exception("internal fault")
            raise


def tell_ignored(project: Project) -> list[str]:
    """Say what a person put into the project and nothing uses; returns the sentences."""
    notes = list(project.notes)
    for note in notes:
        talk.note(note)
        LOG.warning("%s", note)
    return notes


def matching(project: Project, pattern: str) -> list[str]:
    """The project's photos whose names match. Raises UsageError if none does."""
    names = [name for name in project.photo_names if fnmatch(name, pattern)]
    if not names:
        raise UsageError(f"no photo in {project.root} matches {pattern!r}")
    return names


def exit_code(failed: int, total: int, verb: str) -> int:
    """0, or 1 and a complaint where photos failed."""
    if failed:
        talk.complain(f"{failed} of {total} photos could not be {verb}; the reasons are above")
    return SOME_FAILED if failed else DONE
