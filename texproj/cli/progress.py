"""How far long work is, on standard error: bars in a terminal, a few lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from texproj.cli import talk
from texproj.errors import printable
from texproj.stages.progress import Progress

LINE_EVERY_S = 10.0
"""Logs and pipes get the beginning of each stage, and then at most one line in this time."""
SURE_AFTER_S = 3.0
"""Before, the time left is a guess that jumps."""


@contextmanager
def shown_progress() -> Iterator[Progress]:
    """Shows the progress that it yields, in the way that standard error can."""
    if not sys.stderr.isatty():
        yield progress_lines(talk.tell_progress, time.monotonic)
        return
    with _bars() as bars:
        tasks: dict[str, Any] = {}

        def show(stage: str, done: int, total: int, item: str) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, item="")
            bars.update(tasks[stage], completed=done, total=total, item=printable(item))

        yield show


def progress_lines(say: Callable[[str], None], clock: Callable[[], float]) -> Progress:
    """Progress as lines: one where a stage begins, then at most one in LINE_EVERY_S.

    say: takes a line; clock: seconds, of any origin.
    """
    began: dict[str, float] = {}
    said: dict[str, str] = {}
    said_at = -LINE_EVERY_S

    def show(stage: str, done: int, total: int, item: str) -> None:
        nonlocal said_at
        now = clock()
        if stage in began and now - said_at < LINE_EVERY_S:
            return
        elapsed = now - began.setdefault(stage, now)
        how_far = f"{done} of {total}{_left(elapsed, done, total)}" if total else "begins"
        line = f"{stage}: {how_far}  {item}".rstrip()
        if said.get(stage) == line:  # nothing was done since
            return
        said[stage], said_at = line, now
        say(line)

    return show


def _left(elapsed: float, done: int, total: int) -> str:
    """The time left in words, where the part that is done tells it."""
    if elapsed < SURE_AFTER_S or not 0 < done < total:
        return ""
    seconds = elapsed * (total - done) / done
    return (
        f", about {seconds / 60:.0f} min left" if seconds > 90 else f", about {seconds:.0f} s left"
    )


def _bars() -> Any:
    from rich.console import Console  # noqa: PLC0415 - commands that only tell start faster
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description:10}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(compact=True),
        TextColumn("{task.fields[item]}", markup=False),
    )
    return Progress(*columns, console=Console(stderr=True))
