"""One project on show: what all pages share."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from texproj.errors import TexprojError
from texproj.files import json_hash
from texproj.formats.models.binary import required_extensions
from texproj.formats.models.glb import IMAGE_EXTENSIONS
from texproj.mesh import MeshSource
from texproj.options import PreviewOptions
from texproj.preview.events import Hub
from texproj.preview.jobs import Job, Jobs
from texproj.preview.photos import photo_facts
from texproj.preview.surface import Surface
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.progress import Progress

T = TypeVar("T")

MODEL_FILES = {
    "model.ply": "application/octet-stream",
    "model.glb": "model/gltf-binary",
}
"""What the page may fetch from out/, and as what."""


class SharedBench(Workbench):
    """A workbench on the mesh that is already loaded for the page."""

    def __init__(self, project: Project, surface: Surface) -> None:
        super().__init__(project)
        self._surface = surface

    @cached_property
    def source(self) -> MeshSource:
        return self._surface.source


class Session:
    """The project folder, its mesh, the work under way and the pages that look at them."""

    def __init__(self, root: Path, options: PreviewOptions) -> None:
        self.root = root
        self.options = options
        self.hub = Hub()
        self.jobs = Jobs(self.hub)
        self.picks_lock = threading.Lock()
        self._surface: Surface | None = None
        self._surface_lock = threading.Lock()
        self._kept: dict[str, Any] = {}

    @property
    def project(self) -> Project:
        """The project as the folder is now. Raises TexprojError for a broken one."""
        return Project.open(self.root)

    @property
    def surface(self) -> Surface:
        """The mesh as the folder is now. Raises InputError if there is none."""
        project = self.project
        with self._surface_lock:
            key = project.hash_of(project.mesh_path)
            if self._surface is None or self._surface.key != key:
                self._surface = Surface(project, self.options.light_faces)
            return self._surface

    def facts(self) -> dict[str, Any]:
        """All that the page shows beside pictures. Raises InputError for broken cameras.json."""
        project = self.project
        entries = project.load_cameras()
        names = project.photo_names
        return {
            "name": self.root.resolve().name,
            "mesh": {"key": project.hash_of(project.mesh_path), "file": project.mesh_path.name},
            "photos": [photo_facts(project, name, entries.get(name)) for name in names],
            "models": {name: shown_stamp(project.out / name) for name in MODEL_FILES},
            "jobs": [job.as_dict() for job in self.jobs.active],
        }

    def start(
        self,
        kind: str,
        title: str,
        work: Callable[[Workbench, Progress], Any],
        subject: str = "",
        project: Project | None = None,
    ) -> tuple[Job, Any]:
        """Queue `work` on a workbench of its own; returns the job and the future of its result."""
        chosen = project or self.project

        def run(progress: Progress) -> Any:
            with SharedBench(chosen, self.surface) as bench:
                return work(bench, progress)

        return self.jobs.start(kind, title, run, subject)

    def kept(self, key: list[Any], make: Callable[[], T]) -> T:
        """The value kept for `key`, else made now."""
        value = self.recall(key)
        if value is None:
            value = make()
            self.keep(key, value)
        return value

    def recall(self, key: list[Any]) -> Any:
        """The value kept for `key`; None if there is none."""
        return self._kept.get(json_hash(key))

    def keep(self, key: list[Any], value: Any) -> None:
        """Keep a value in memory; only the latest few are."""
        self._kept[json_hash(key)] = value
        while len(self._kept) > KEPT_VALUES:
            self._kept.pop(next(iter(self._kept)))

    def warm_up(self) -> None:
        """Start to load and simplify the mesh before anybody asks."""
        threading.Thread(target=self._warm_up, name="texproj-mesh", daemon=True).start()

    def _warm_up(self) -> None:
        with contextlib.suppress(TexprojError):  # whoever asks for the mesh is told why
            self._warm_surface()

    def _warm_surface(self) -> None:
        surface = self.surface
        ready = surface.full_pack and surface.light_pack
        self.hub.send("light" if ready else "no-light", {})

    def close(self) -> None:
        """Stop work and streams."""
        self.jobs.close()
        self.hub.close()


KEPT_VALUES = 8


def stamp(path: Path) -> str | None:
    """Something that changes when a file is written; None if there is none."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return f"{stat.st_mtime_ns:x}-{stat.st_size:x}"


def shown_stamp(path: Path) -> str | None:
    """`stamp` of a model that the page can show: not one with images in KTX 2."""
    try:
        hidden = IMAGE_EXTENSIONS["ktx2"] in required_extensions(path)
    except OSError:
        return None
    return None if hidden else stamp(path)


def stamps(root: Path) -> dict[str, str | None]:
    """What the page watches in a project folder, by path relative to it."""
    fixed = [root / "cameras.json", root / "project.toml"]
    found = [p for folder in WATCHED for p in (root / folder).glob("*") if p.is_file()]
    return {p.relative_to(root).as_posix(): stamp(p) for p in [*fixed, *found]}


WATCHED = ("correspondences", "out", "photos")


def changed(before: dict[str, str | None], after: dict[str, str | None]) -> set[str]:
    """Paths that appeared, went or were written."""
    return {p for p in before.keys() | after.keys() if before.get(p) != after.get(p)}
