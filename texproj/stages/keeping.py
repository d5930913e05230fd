"""What was registered is kept: at once while that is cheap, else at intervals, and at the end."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any

from texproj.errors import OutputError
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.traces import STAGE, Trace, keep_blocks

SHARE = 0.05
"""Most of the time that may go into writing cameras.json: it is written as a whole, and grows with
the photos. So it is written after each photo where that is quick, and a killed run never loses
more than the work of twenty times as long as one write takes."""


class Keeper:
    """Writes entries and their traces; a context manager that writes the rest however it ends."""

    def __init__(self, project: Project) -> None:
        self._project = project
        self._records: dict[str, CameraRecord] = {}
        self._traces: dict[str, Trace] = {}
        self._next = 0.0

    def __enter__(self) -> Keeper:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if not isinstance(error, OutputError):
            self.write()

    def add(self, record: CameraRecord, trace: Trace) -> None:
        """One more photo is done. Raises OutputError; camera and trace are the old ones then."""
        self._records[record.file], self._traces[record.file] = record, trace
        if time.monotonic() >= self._next:
            self.write()

    def write(self) -> None:
        """Write what is not written yet. Raises OutputError."""
        if not self._records:
            return
        begin = time.monotonic()
        made: dict[str | None, Any] = {
            name: trace.as_dict() for name, trace in self._traces.items()
        }
        keep_blocks(self._project, self._traces)
        self._project.save_registration(self._records.values(), STAGE, made)
        self._records, self._traces = {}, {}
        end = time.monotonic()
        self._next = end + (end - begin) / SHARE
