"""One writer on a project at a time: the second waits, and says for whom."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from texproj.errors import OutputError
from texproj.files import write_failure

LOCK, WHO = "lock", "at-work.json"
LOOK_S = 0.2
"""Seconds between two looks whether the other one has ended; Ctrl-C is heard between them."""

Tell = Callable[[str], None]


@contextmanager
def at_work(folder: Path, command: str, tell: Tell) -> Iterator[None]:
    """Hold `folder` while the block runs; the system lets go of it however the process ends.

    Where another process holds it, `tell` gets one sentence that says which, and the block waits.
    A process that holds the folder already goes on at once. Raises OutputError for a folder that
    cannot be written.
    """
    from filelock import FileLock, Timeout  # noqa: PLC0415 - loads asyncio: slow, for writers only

    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK, is_singleton=True)
        told = False
        while True:
            try:
                lock.acquire(timeout=0)
                break
            except Timeout:
                if not told:
                    tell(f"{_who(folder)} is at work on {folder.parent}; waiting until it is done")
                told = True
                time.sleep(LOOK_S)
        (folder / WHO).write_text(json.dumps(_own(command)), encoding="utf-8")
    except OSError as error:
        raise OutputError(write_failure(folder, error)) from None
    try:
        yield
    finally:
        if lock.lock_counter == 1:
            with suppress(OSError):
                (folder / WHO).unlink()
        lock.release()


def _own(command: str) -> dict[str, str | int]:
    now = time.strftime("%H:%M")
    return {"command": command, "process": os.getpid(), "host": socket.gethostname(), "since": now}


def _who(folder: Path) -> str:
    """Who holds the folder, as far as it is told."""
    try:
        told = json.loads((folder / WHO).read_text(encoding="utf-8"))
        return (
            f"`texproj {told['command']}` (process {told['process']} on {told['host']}, since "
            f"{told['since']})"
        )
    except (OSError, ValueError, KeyError, TypeError):
        return "another texproj"
