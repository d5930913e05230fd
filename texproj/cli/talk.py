"""What a command says: results on standard output, progress and complaints on standard error."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from texproj.stages.progress import Progress, silent


def say(text: str = "") -> None:
    """One line of the result, for a person."""
    sys.stdout.write(text + "\n")


def complain(text: str) -> None:
    """One line about what went wrong."""
    sys.stderr.write(f"texproj: {text}\n")


def note(text: str) -> None:
    """One line about what a person may not expect."""
    sys.stderr.write(f"note: {text}\n")


def say_json(value: Any) -> None:
    """The result, for a machine."""
    sys.stdout.write(json.dumps(value, indent=1, default=str) + "\n")


def talk_about_details(wanted: bool) -> None:
    """With -v: what happens inside, on standard error."""
    if wanted:
        logging.basicConfig(stream=sys.stderr, format="%(relativeCreated)7.0f ms  %(message)s")
        logging.getLogger("texproj").setLevel(logging.INFO)


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Bars on standard error, one a stage; nothing where that is not a terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield silent
        return
    columns = (
        TextColumn("{task.description:10}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[item]}"),
    )
    with Bars(*columns, console=console) as bars:
        tasks: dict[str, Any] = {}

        def show(stage: str, done: int, total: int, item: str) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, item=item)
            bars.update(tasks[stage], completed=done, total=total, item=item)

        yield show
