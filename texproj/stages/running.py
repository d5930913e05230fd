"""Stage `run`: whatever is stale, in order, then the report; and what `status` tells of it."""

from __future__ import annotations

from dataclasses import dataclass

from texproj.errors import InputError
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.coloring import ColorOutcome, color_freshness, color_project
from texproj.stages.freshness import Freshness
from texproj.stages.progress import Progress, silent
from texproj.stages.registering import (
    PhotoOutcome,
    register_photos,
    registration_freshness,
)
from texproj.stages.reporting import ReportOutcome, report_freshness, report_project


@dataclass(frozen=True, eq=False)
class RunOutcome:
    """What each stage did. color is None where no photo could be registered; `reason` says so."""

    photos: list[PhotoOutcome]
    color: ColorOutcome | None
    report: ReportOutcome
    reason: str = ""

    @property
    def failed(self) -> dict[str, str]:
        """The photos that did not make it into the model, and why."""
        unregistered = {o.name: o.reason for o in self.photos if o.failed}
        return {**unregistered, **(self.color.failed if self.color else {})}


def run_project(bench: Workbench, progress: Progress = silent) -> RunOutcome:
    """Register, color and report what is stale. Raises InputError for an unusable project."""
    photos = register_photos(bench, progress=progress)
    try:
        color, reason = color_project(bench, progress), ""
    except InputError as error:
        color, reason = None, str(error)
    report = report_project(bench, progress)
    return RunOutcome(photos, color, report, reason)


def project_status(project: Project) -> list[Freshness]:
    """Each item of each stage: fresh, or stale and why. Raises InputError."""
    return [*registration_freshness(project), color_freshness(project), report_freshness(project)]
