"""What all commands share: their common parameters, opening a project, the exit code."""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from texproj.cli import talk
from texproj.cli.exits import DONE, SOME_FAILED
from texproj.cli.flags import apply_flags
from texproj.errors import UsageError
from texproj.project import Project

Folder = Annotated[Path, Parameter(name="DIR", help="The project folder.", show_default=False)]
Json = Annotated[bool, Parameter(name="--json", negative="", help="Print the outcome as JSON.")]
Verbose = Annotated[
    bool, Parameter(name=["--verbose", "-v"], negative="", help="Tell what happens inside.")
]


def open_project(folder: Path, flags: Any, verbose: bool) -> Project:
    """The project in `folder` with the flags that were given over its settings."""
    talk.talk_about_details(verbose)
    project = Project.open(folder)
    project = project.with_settings(apply_flags(project.settings, flags))
    project.remove_unfinished()
    return project


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
