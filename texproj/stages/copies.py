"""A project's files on machines of a cluster that do not see its folder: copied for one run."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import gettempdir
from typing import Any, TypeVar

from texproj.errors import InputError
from texproj.project import Project
from texproj.resources.cluster import ALONE_S, Cluster, ClusterError, host_of
from texproj.resources.workers import LISTEN_S, WorkerLostError

Machine = tuple[str, str]
T = TypeVar("T")

PREFIX = "texproj-copy-"
BLOCK = 16 << 20
"""Bytes that are sent at once: the scheduler holds as many."""
FORGOTTEN_S = 86_400
"""After which a copy that no task has used belongs to a run that was killed."""


@dataclass(frozen=True, eq=False)
class Copies:
    """project: its root resolved; run: another word for each run; machines: host and folder of each
    copy.
    """

    cluster: Cluster
    project: Project
    run: str
    machines: frozenset[Machine]
    _sent: dict[Path, tuple[int, int]] = field(default_factory=dict)

    @classmethod
    def begun(cls, cluster: Cluster, project: Project, run: str) -> Copies:
        """Empty ones on all machines."""
        return cls(cluster, project, run, frozenset(_machines(cluster, run)))

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
            with suppress(OSError):  # of this machine: whoever reads the file says what is wrong
                stat = path.stat()
                stamp = (stat.st_size, stat.st_mtime_ns)
                if self._sent.get(path) != stamp:
                    self._send(path)
                    self._sent[path] = stamp

    def _send(self, path: Path) -> None:
        inside = self._inside(path)
        for start, data in _blocks(path):
            for worker, why in self._on_each_machine(_write, inside, start, data).items():
                if why is not None:
                    raise InputError(f"{path} cannot be copied to the worker at {worker}: {why}")

    def _inside(self, path: Path) -> str:
        """Where a file is in the project folder, a link by its own place. Raises InputError."""
        for place in (Path(os.path.normpath(path)), path.parent.resolve() / path.name):
            if place.is_relative_to(self.project.root):
                return place.relative_to(self.project.root).as_posix()
        raise InputError(
            f"{path} lies outside the project folder, which workers do not see: put it there, or"
            " the folder on storage that all workers share"
        )

    def _on_each_machine(self, work: Callable[..., T], *args: Any) -> dict[str, T]:
        """What ``work(run, *args)`` gives in one worker of each machine, which may have ended and
        be back soon. Raises ClusterError.
        """
        end = time.monotonic() + ALONE_S
        while time.monotonic() < end:
            with suppress(WorkerLostError):
                there = _machines(self.cluster, self.run)
                if self.machines <= there.keys():
                    workers = [there[machine] for machine in self.machines]
                    return self.cluster.everywhere(work, self.run, *args, at=workers)
            time.sleep(LISTEN_S)
        raise ClusterError(
            f"a machine of the cluster at {self.cluster.address} has no worker any more; what was"
            " done is kept: start one there, or leave it out, then the same command again"
        )


def _machines(cluster: Cluster, run: str) -> dict[Machine, str]:
    """A worker of each machine, where the copy has been begun."""
    places = cluster.everywhere(begin, run)
    return {(host_of(worker), place): worker for worker, place in places.items()}


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
    """Where on this machine a copy is; a new one is begun, and those that a killed run left go."""
    if copy_of(run).is_dir():
        return str(copy_of(run))
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
