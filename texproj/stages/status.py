"""What `status` tells: each item of each stage, fresh or stale, without loading what makes it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from texproj.project import Project
from texproj.stages.appearing import appearance_freshness, appearance_wanted
from texproj.stages.coloring import color_freshness
from texproj.stages.freshness import Freshness
from texproj.stages.lineage import registration_freshness
from texproj.stages.outcomes import Tally
from texproj.stages.refining import refine_freshness, unrefined
from texproj.stages.reporting import report_freshness

SWITCHED_OFF = "switched off since then; the next run goes back to each photo's own registration"


@dataclass(frozen=True)
class StatusOutcome:
    """Each item of each stage, and what is known of the photos, in one sentence; question: what
    somebody has to choose.
    """

    items: list[Freshness]
    story: str = ""
    question: str = ""

    @property
    def tally(self) -> Tally:
        return Tally(0, len(self.items), "looked at")

    def lines(self) -> Iterator[str]:
        """For people."""
        for item in self.items:
            yield from item.lines()
        if self.story:
            yield self.story
        if self.question:
            yield self.question

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        items = [item.as_dict() for item in self.items]
        return {"items": items, "story": self.story, "question": self.question}


def project_status(project: Project) -> list[Freshness]:
    """Each item of each stage: fresh, failed with nothing changed since, or stale and why. Raises
    InputError.
    """
    refined = [refine_freshness(project, True)] if worth_refining(project) else []
    if unrefined(project):
        refined = [Freshness("refine", "all photos", False, SWITCHED_OFF)]
    light = [appearance_freshness(project)] if appearance_wanted(project) else []
    after = [color_freshness(project), *light, report_freshness(project)]
    return [*registration_freshness(project), *refined, *after]


def worth_refining(project: Project) -> bool:
    """Whether the settings want it and there is a camera of our own beside another one."""
    entries = project.load_cameras().values()
    registered = [e for e in entries if e.registered_camera and e.file in project.photo_paths]
    own = any(e.sought for e in registered)
    return bool(project.settings.refine.enabled and own and len(registered) > 1)
