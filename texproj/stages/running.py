"""Stage `run`: whatever is stale, in order, then the report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from texproj.errors import InputError
from texproj.records import CameraRecord
from texproj.stages.appearing import AppearanceOutcome, appearance_project
from texproj.stages.attending import PhotoFaultError, attended
from texproj.stages.bench import Workbench
from texproj.stages.choosing import told_of
from texproj.stages.coloring import ColorOutcome, color_project
from texproj.stages.outcomes import PhotoOutcome, Tally
from texproj.stages.progress import Progress, silent
from texproj.stages.refining import (
    RefineOutcome,
    refine_project,
    undo_refinement,
)
from texproj.stages.registering import register_photos
from texproj.stages.reporting import ReportOutcome, report_project
from texproj.stages.status import worth_refining
from texproj.stages.story import story

NONE_REGISTERED = "no photo could be registered, so there is no model; each says what it needs"


@dataclass(frozen=True, eq=False)
class RunOutcome:
    """What each stage did. color is None where no photo could be registered; `reason` says so.
    appearance is None too where [light] does not ask for it.

    unrefined: photos that are back at their own registration, since the settings have switched
    refinement off; fault: why refinement could not be done, which nobody foresaw; question: what
    somebody has to choose.
    """

    photos: list[PhotoOutcome]
    refined: RefineOutcome | None
    color: ColorOutcome | None
    appearance: AppearanceOutcome | None
    report: ReportOutcome
    reason: str = ""
    unrefined: tuple[str, ...] = ()
    fault: str = ""
    question: str = ""

    @property
    def failed(self) -> dict[str, str]:
        """The photos that did not make it into the model, and why."""
        unregistered = {o.name: o.reason for o in self.photos if o.failed}
        thrown_out = self.refined.thrown_out if self.refined else {}
        return {**unregistered, **thrown_out, **(self.color.failed if self.color else {})}

    @property
    def story(self) -> str:
        """What became of the photos, in one sentence."""
        return story(self.photos, self.refined is not None, self.failed)

    @property
    def tally(self) -> Tally:
        unusable = self.reason if self.color is None else ""
        return Tally(len(self.failed), len(self.photos), "used", unusable, self.fault)

    def lines(self) -> Iterator[str]:
        """For people."""
        for photo in self.photos:
            yield from photo.lines()
        if told := self.story:
            yield told
        if self.question:
            yield self.question
        if self.unrefined:
            names = ", ".join(self.unrefined)
            yield f"refinement is switched off: back to their own registration: {names}"
        if self.color is not None:
            yield from self.color.lines()
        if self.appearance is not None:
            yield from self.appearance.lines()
        yield f"report: {self.report.files[0]}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {
            "photos": [photo.as_dict() for photo in self.photos],
            "refine": self.refined and self.refined.as_dict(),
            "color": self.color and self.color.as_dict(),
            "appearance": self.appearance and self.appearance.as_dict(),
            "report": self.report.as_dict()["files"],
            "reason": self.reason,
            "story": self.story,
            "unrefined": self.unrefined,
            "fault": self.fault,
            "question": self.question,
        }


def run_project(bench: Workbench, progress: Progress = silent) -> RunOutcome:
    """Register, refine, color and report what is stale. Raises InputError, OutputError."""
    project = bench.project
    project.check_writable(project.work, project.out)
    photos = register_photos(bench, progress=progress)
    back = undo_refinement(project)
    refined, fault = _refined(bench, progress)
    entries = project.load_cameras()
    photos = [_with_record(outcome, entries[outcome.name]) for outcome in photos]
    try:
        color, reason = color_project(bench, progress), ""
    except InputError as error:
        color, reason = None, NONE_REGISTERED if all(p.failed for p in photos) else str(error)
    wanted = color is not None and project.settings.light.kind != "none"
    appearance = appearance_project(bench, progress) if wanted else None
    report = report_project(bench, progress)
    question = told_of(project)
    return RunOutcome(photos, refined, color, appearance, report, reason, back, fault, question)


def _refined(bench: Workbench, progress: Progress) -> tuple[RefineOutcome | None, str]:
    """What refining did, and why it could not be done if it met a fault: each photo keeps its own
    registration then.
    """
    if not worth_refining(bench.project):
        return None, ""

    def refine() -> RefineOutcome:
        return refine_project(bench, progress, in_run=True)

    try:
        return attended("all photos together", refine), ""
    except PhotoFaultError as error:
        return None, f"the photos were not refined together: {error}"
    except InputError:  # fewer than two photos can be read; the color stage names them
        return None, ""


def _with_record(outcome: PhotoOutcome, record: CameraRecord) -> PhotoOutcome:
    return replace(outcome, record=record, reason=record.quality.get("reason") or outcome.reason)
