"""What the page remembers of a project, in work/."""

from __future__ import annotations

from texproj.project import Project

AXES = ("x", "-x", "y", "-y", "z", "-z")
PAGE = "page"
"""Name of the record."""


def remember_up(project: Project, axis: str) -> None:
    """Keep which axis a person chose to be up. Raises OutputError."""
    project.save_record(PAGE, None, {"inputs": {}, "up": axis})


def chosen_up(project: Project) -> str | None:
    """The axis that a person chose to be up on the page."""
    axis = (project.load_record(PAGE) or {}).get("up")
    return axis if axis in AXES else None
