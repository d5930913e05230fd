"""What the page shows of photos that are being placed all together, or fit in several places."""

from __future__ import annotations

import time
from typing import Any

from texproj.preview.photos import camera_facts
from texproj.preview.session import Session
from texproj.project import Project
from texproj.stages.choosing import FOLDER, Place, Question, questions
from texproj.stages.drafting import RECORD, draft_of

FORGOTTEN_S = 60.0
"""A draft older than this is left from a run that was killed."""


def places_facts(session: Session) -> dict[str, Any]:
    """The best place so far, and the places among which somebody has to choose, or chose last;
    None each where there are none. Raises TexprojError.
    """
    project = session.project
    draft = draft_of(project) if _is_new(project) else None
    known = questions(project)
    question = next((q for q in known if q.is_open), known[-1] if known else None)
    return {
        "draft": draft and _place(draft),
        "question": question and _question(question),
    }


def _is_new(project: Project) -> bool:
    path = project.record_path(FOLDER, RECORD)
    try:
        return time.time() - path.stat().st_mtime < FORGOTTEN_S
    except OSError:
        return False


def _question(question: Question) -> dict[str, Any]:
    return {
        "photos": [*question.photos],
        "looks": question.looks,
        "places": [_place(place) for place in question.places],
        "answer": question.answer,
    }


def _place(place: Place) -> dict[str, Any]:
    cameras = {name: camera_facts(camera) for name, camera in place.by_name().items()}
    return {"support": place.support, "points": place.points, "cameras": cameras}
