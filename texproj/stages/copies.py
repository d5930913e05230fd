"""A project's files on machines of a cluster that do not see its folder: copied for one run."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import gettempdir

from texproj.errors import InputError
from texproj.project import Project
from texproj.resources.cluster import Cluster

PREFIX = "texproj-copy-"
BLOCK = 16 << 20
"""Bytes that are sent at once: the scheduler holds as many."""
FORGOTTEN_S = 86_400
"""After which a copy that no task has used belongs to a run that was killed."""


@dataclass(frozen=True, eq=False)
class Copies:
    """run: another word for each run; workers: addresses, one of each machine."""

    cluster: Cluster
    project: Project
    run: str
    workers: Sequence[str]
    _sent: dict[Path, tuple[int, int]] = field(default_factory=dict)

    def bring_inputs(self) -> None:
        """Send what a person put into the project. Raises InputError."""
        project = self.project
        mesh = project.mesh_path
        beside = mesh if mesh.parent.samefile(project.root) else mesh.parent
        self.bring(beside, project.photos, project.masks, project.picks)

    def bring(self, *places: Path) -> None:
        """Send files, and all files of folders, that are new or have changed since they were sent.

        Raises InputError for a file outside the project folder, and where a machine has no room.
        """
        for path in (file for place in places for file in _files(place)):
            stat = path.stat()
            stamp = (stat.st_size, stat.st_mtime_ns)
            if self._sent.get(path) != stamp:
                self._send(path)
                self._sent[path] = stamp

    def _send(self, path: Path) -> None:
        try:
            inside = path.resolve().relative_to(self.project.root.resolve()).as_posix()
        except ValueError:
            raise InputError(
                f"{path} lies outside the project folder, which workers do not see: put it there,"
                " or the folder on storage that all workers share"
            ) from None
        for start, data in _blocks(path):
            told = self.cluster.everywhere(_write, self.run, inside, start, data, at=self.workers)
            for worker, why in told.items():
                if why is not None:
                    raise InputError(f"{path} cannot be copied to the worker at {worker}: {why}")


def _files(place: Path) -> Iterator[Path]:
    if place.is_file():
        yield place
    elif place.is_dir():
        yield from (p for p in sorted(place.rglob("*")) if p.is_file())


def _blocks(path: Path) -> Iterator[tuple[int, bytes]]:
    """Where they begin, and the bytes; one of an empty file."""
    with path.open("rb") as file:
        yield 0, file.read(BLOCK)
        while data := file.read(BLOCK):
            yield file.tell() - len(data), data


# --- in a worker


def copy_of(run: str) -> Path:
    """The folder of a copy on this machine."""
    return Path(gettempdir()) / f"{PREFIX}{run}"


def begin(run: str) -> str:
    """Where on this machine a new copy will be; those that a killed run left go."""
    for old in Path(gettempdir()).glob(f"{PREFIX}*"):
        with suppress(OSError):  # of somebody else
            if time.time() - old.stat().st_mtime > FORGOTTEN_S:
                shutil.rmtree(old, ignore_errors=True)
    copy_of(run).mkdir(mode=0o700, exist_ok=True)
    return str(copy_of(run))


def in_use(run: str) -> Path:
    """The folder of a copy, which stays as long as it is asked for."""
    os.utime(copy_of(run))
    return copy_of(run)


def end(run: str) -> None:
    """Remove a copy."""
    shutil.rmtree(copy_of(run), ignore_errors=True)


def _write(run: str, inside: str, start: int, data: bytes) -> str | None:
    """Why a block cannot be written, None where it is."""
    path = copy_of(run) / inside
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("r+b" if start else "wb") as file:
            file.seek(start)
            file.write(data)
    except OSError as error:
        return f"{error.strerror} ({gettempdir()}, which TMPDIR names)"
    return None
