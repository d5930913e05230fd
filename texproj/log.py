"""The log of a project: what was done, on which machine, what was refused and why, and tracebacks
of internal faults. It rotates, so it never grows beyond a few megabytes.
"""

from __future__ import annotations

import logging
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from logging.handlers import RotatingFileHandler
from pathlib import Path

from texproj.errors import OutputError, printable
from texproj.files import write_failure

LOG_FILE = "texproj.log"
MOST_BYTES, OLDER_FILES = 1_000_000, 3
LINE = "%(asctime)s %(levelname)-7s %(process)d %(name)s: %(message)s"
REPORTED = ("numpy", "scipy", "opencv-contrib-python-headless", "moderngl", "embreex", "trimesh")
"""Packages whose versions stand at the beginning of every run, since faults depend on them."""

logger = logging.getLogger("texproj")


class _OneLine(logging.Formatter):
    """A message is one line, whatever names from files stand in it; a traceback follows it."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        record.message = printable(record.message)
        return super().formatMessage(record)


def machine() -> str:
    """What this program runs on, in one line."""
    packages = ", ".join(f"{name} {_version(name)}" for name in REPORTED)
    return (
        f"texproj {_version('texproj')}, Python {platform.python_version()}, {platform.platform()},"
        f" {os.cpu_count()} cores; {packages}"
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


@contextmanager
def logged(folder: Path, command: str) -> Iterator[Path]:
    """Everything that "texproj" logs goes to a file in `folder` while the block runs.

    Yields the file's path. Raises OutputError where it cannot be written.
    """
    path = folder / LOG_FILE
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handler = RotatingFileHandler(
            path,
            maxBytes=MOST_BYTES,
            backupCount=OLDER_FILES,
            encoding="utf-8",
            errors="backslashreplace",
        )
    except OSError as error:
        raise OutputError(write_failure(folder, error)) from None
    handler.setFormatter(_OneLine(LINE))
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        logger.info("%s (%s)", command, machine())
        yield path
    finally:
        logger.setLevel(before)
        logger.removeHandler(handler)
        handler.close()
