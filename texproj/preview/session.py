"""One project on show: what all pages share."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from texproj.at_work import at_work
from texproj.errors import OutputError, TexprojError
from texproj.files import STAGING_PREFIX, json_hash
from texproj.formats.models.binary import required_extensions
from texproj.formats.models.glb import IMAGE_EXTENSIONS
from texproj.log import logged
from texproj.mesh import MeshSource
from texproj.options import PreviewOptions
from texproj.preview.door import check_picks, check_texts, leaves
from texproj.preview.events import Hub
from texproj.preview.jobs import Job, Jobs
from texproj.preview.memory import chosen_up
from texproj.preview.photos import Pictures, photo_facts
from texproj.preview.surface import Surface
from texproj.project import Project
from texproj.stages.appearance_files import MODEL_GLB
from texproj.stages.appearing import STAGE as APPEARANCE
from texproj.stages.bench import Workbench
from texproj.stages.progress import Cancelled, Progress

T = TypeVar("T")

LOG = logging.getLogger("texproj.preview")

MODEL_FILES = {
    "model.ply": "application/octet-stream",
    "model.glb": "model/gltf-binary",
    "appearance.ply": "application/octet-stream",
}
"""What the page may fetch from out/, and as what."""


class SharedBench(Workbench):
    """A workbench on the mesh that is already loaded for the page; it keeps nothing on disk for
    work that only looks.
    """

    def __init__(self, project: Project, surface: Surface, looks: bool) -> None:
        super().__init__(project)
        self._surface = surface
        self._looks = looks

    @cached_property
    def source(self) -> MeshSource:
        return self._surface.source

    @cached_property
    def occlusion(self) -> NDArray[np.float32]:
        if not self._looks:
            return super().occlusion
        known = self.kept_occlusion
        return self._surface.occlusion if known is None else known


class Session:
    """The project folder, its mesh, the work under way and the pages that look at them."""

    def __init__(self, root: Path, options: PreviewOptions) -> None:
        self.root = root
        self.options = options
        self.hub = Hub()
        self.jobs = Jobs(self.hub)
        self.edit_lock = threading.Lock()
        self.pictures = Pictures()
        self._project: tuple[tuple[str | None, ...], Project] | None = None
        self._project_lock = threading.Lock()
        self._surface: Surface | None = None
        self._surface_lock = threading.Lock()
        self._kept: dict[str, Any] = {}

    @property
    def project(self) -> Project:
        """The project as the folder is now, opened again only when a file of it came or went.

        Raises TexprojError for a broken one.
        """
        check_texts(self.root)
        with self._project_lock:
            before = self._project[1] if self._project else None
            key = self._folder_key(before)
            if before is None or self._project is None or self._project[0] != key:
                before = Project.open(self.root).with_hashes_of(before)
                self._project = self._folder_key(before), before
            return before

    def _folder_key(self, project: Project | None) -> tuple[str | None, ...]:
        """Changes when the settings do, and when a file in one of the folders comes or goes."""
        photos = project.photos if project else self.root / "photos"
        folders = [self.root / name for name in ("mesh", "masks", "correspondences")]
        return tuple(stamp(p) for p in (self.root / "project.toml", photos, *folders))

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
        names, report = project.photo_names, project.out / "report.html"
        return {
            "name": self.root.resolve().name,
            "mesh": {"key": project.hash_of(project.mesh_path), "file": project.mesh_path.name},
            "photos": [photo_facts(project, name, entries.get(name)) for name in names],
            "excluded": list(project.settings.exclude),
            "to": project.settings.color.to,
            "lit": lit_texture(project),
            "up": chosen_up(project),
            "report": None if leaves(report, self.root) else stamp(report),
            "models": {name: shown_stamp(project.out / name, self.root) for name in MODEL_FILES},
            "jobs": [job.as_dict() for job in self.jobs.active],
        }

    def start(
        self,
        kind: str,
        title: str,
        work: Callable[[Workbench, Progress], Any],
        subject: str = "",
        looks: bool = False,
    ) -> tuple[Job, Any]:
        """Queue `work` on a workbench of its own; returns the job and the future of its result.

        looks: nothing is written to the project. Raises InputError, TooManyJobs.
        """
        project = self.project
        if not looks:
            check_picks(self.root)

        def run(progress: Progress) -> Any:
            try:
                with ExitStack() as open_now:
                    if not looks:
                        open_now.enter_context(at_work(project.work, f"preview: {title}", LOG.info))
                        open_now.enter_context(logged(project.log_folder, f"preview: {title}"))
                    bench = open_now.enter_context(SharedBench(project, self.surface, looks))
                    return work(bench, progress)
            except (TexprojError, Cancelled):
                raise
            except BaseException as error:
                self.log_fault(title, error)
                raise

        return self.jobs.start(kind, title, run, subject)

    def log_fault(self, what: str, error: BaseException) -> None:
        """Write what nobody foresaw, with its traceback, to the project's log."""
        with contextlib.suppress(OutputError), logged(self.root / "work" / "log", "preview"):
            LOG.error("%s failed", what, exc_info=error)

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
        ready = surface.first_pack and surface.light_pack
        self.hub.send("light" if ready else "no-light", {})

    def close(self) -> None:
        """Stop work and streams."""
        self.jobs.close()
        self.hub.close()


KEPT_VALUES = 8


def lit_texture(project: Project) -> bool:
    """Whether out/model.glb is that of `appearance`, which has base colors."""
    made = (project.load_record(APPEARANCE) or {}).get("outputs", {}).get(MODEL_GLB)
    return made is not None and made == project.hash_of(project.out / MODEL_GLB)


def stamp(path: Path) -> str | None:
    """Something that changes when a file is written; None if there is none."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return f"{stat.st_mtime_ns:x}-{stat.st_size:x}"


def shown_stamp(path: Path, root: Path) -> str | None:
    """`stamp` of a model that the page can show: not one with images in KTX 2, nor a link."""
    if leaves(path, root):
        return None
    try:
        hidden = IMAGE_EXTENSIONS["ktx2"] in required_extensions(path)
    except OSError:
        return None
    return None if hidden else stamp(path)


WATCHED = ("correspondences", "out", "photos", "mesh", "masks", "cameras.json", "project.toml")
"""What of a project folder the page wants to hear about, by the first part of its path ..."""
PLACES = ("work/block/now.json", "work/block/places.json")
"""... and of what is kept in work/."""


def shown(path: str, root: Path) -> str | None:
    """The path relative to `root` of a file that the page shows, None for all other files; a
    photo outside of it is named alone.
    """
    try:
        parts = Path(path).relative_to(root).parts
    except ValueError:
        return Path(path).name
    hidden = any(part.startswith(STAGING_PREFIX) for part in parts)
    name = "/".join(parts)
    wanted = name in PLACES or (bool(parts) and parts[0] in WATCHED)
    return name if wanted and not hidden else None
