"""Stage `run`: whatever is stale, in order, then the report; and what `status` tells of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from texproj.errors import InputError
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.bench import Workbench
from texproj.stages.coloring import ColorOutcome, color_freshness, color_project
from texproj.stages.entries import START_KEY
from texproj.stages.freshness import Freshness
from texproj.stages.progress import Progress, silent
from texproj.stages.refining import (
    RefineOutcome,
    refine_freshness,
    refine_project,
    undo_refinement,
    unrefined,
)
from texproj.stages.registering import PhotoOutcome, register_photos, registration_freshness
from texproj.stages.reporting import ReportOutcome, report_freshness, report_project

NONE_REGISTERED = "no photo could be registered, so there is no model; each says what it needs"
SWITCHED_OFF = "switched off since then; the next run goes back to each photo's own registration"


@dataclass(frozen=True, eq=False)
class RunOutcome:
    """What each stage did. color is None where no photo could be registered; `reason` says so.

    unrefined: photos that are back at their own registration, since the settings have switched
    refinement off.
    """

    photos: list[PhotoOutcome]
    refined: RefineOutcome | None
    color: ColorOutcome | None
    report: ReportOutcome
    reason: str = ""
    unrefined: tuple[str, ...] = ()

    @property
    def failed(self) -> dict[str, str]:
        """The photos that did not make it into the model, and why."""
        unregistered = {o.name: o.reason for o in self.photos if o.failed}
        thrown_out = self.refined.thrown_out if self.refined else {}
        return {**unregistered, **thrown_out, **(self.color.failed if self.color else {})}


def run_project(bench: Workbench, progress: Progress = silent) -> RunOutcome:
    """Register, refine, color and report what is stale. Raises InputError, OutputError."""
    project = bench.project
    project.check_writable(project.work, project.out)
    photos = register_photos(bench, progress=progress)
    back = undo_refinement(project)
    refined = _refined(bench, progress)
    entries = project.load_cameras()
    photos = [_with_record(outcome, entries[outcome.name]) for outcome in photos]
    try:
        color, reason = color_project(bench, progress), ""
    except InputError as error:
        color, reason = None, NONE_REGISTERED if all(p.failed for p in photos) else str(error)
    report = report_project(bench, progress)
    return RunOutcome(photos, refined, color, report, reason, back)


def _refined(bench: Workbench, progress: Progress) -> RefineOutcome | None:
    if not _worth_refining(bench.project):
        return None
    try:
        return refine_project(bench, progress, hold_imported=True)
    except InputError:  # fewer than two photos can be read; the color stage names them
        return None


def _with_record(outcome: PhotoOutcome, record: CameraRecord) -> PhotoOutcome:
    return replace(outcome, record=record, reason=record.quality.get("reason") or outcome.reason)


def project_status(project: Project) -> list[Freshness]:
    """Each item of each stage: fresh, or stale and why. Raises InputError."""
    refined = [refine_freshness(project, True)] if _worth_refining(project) else []
    if unrefined(project):
        refined = [Freshness("refine", "all photos", False, SWITCHED_OFF)]
    after = [color_freshness(project), report_freshness(project)]
    return [*registration_freshness(project), *refined, *after]


def _worth_refining(project: Project) -> bool:
    """Whether the settings want it and there is a camera of our own beside another one."""
    entries = project.load_cameras().values()
    registered = [e for e in entries if e.registered_camera and e.file in project.photo_paths]
    own = any(START_KEY in e.extra for e in registered)
    return bool(project.settings.refine.enabled and own and len(registered) > 1)
