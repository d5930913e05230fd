"""The best place so far, kept in work/ while photos are placed, for whoever looks on."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any

from pydantic import ValidationError

from texproj.errors import InputError
from texproj.project import Project
from texproj.register.block.decide import Judged
from texproj.register.block.reconstruction import Reconstruction
from texproj.stages.block_fits import sparse_points
from texproj.stages.choosing import FOLDER, Place, camera_entry

RECORD = "now"
PAUSE_S = 1.0
"""The best place so far is written at most this often."""


class Draft:
    """A context manager; nothing is left when it ends."""

    def __init__(self, project: Project, part: Reconstruction) -> None:
        self._project, self._part = project, part
        self._next = 0.0
        self._written = False

    def __enter__(self) -> Draft:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._written:
            self._project.record_path(FOLDER, RECORD).unlink(missing_ok=True)

    def show(self, best: Judged) -> None:
        """Write a place that is the best so far. Raises OutputError."""
        if time.monotonic() < self._next:
            return
        part, placed = self._part, best.placed
        cameras = placed.cameras(dict(zip(part.names, part.cameras, strict=True)))
        place = Place(
            support=best.support,
            cameras=[camera_entry(name, camera) for name, camera in cameras.items()],
            points=sparse_points(part.points, placed.world_from_block),
        )
        record: dict[str, Any] = {"inputs": {}, **place.model_dump()}
        self._project.save_record(FOLDER, RECORD, record)
        self._written = True
        self._next = time.monotonic() + PAUSE_S


def draft_of(project: Project) -> Place | None:
    """The best place so far of photos that are being placed now; None if there is none."""
    record = project.load_record(FOLDER, RECORD)
    if record is None:
        return None
    try:
        place = Place.model_validate(record)
        place.by_name()
    except (ValidationError, InputError):
        return None
    return place
