"""Photos projected onto the surface by workers: the points lie in the project folder meanwhile."""

from __future__ import annotations

import shutil
import uuid
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.balance.shared_points import PointObserver
from texproj.color.points.source import Chunk, Owners, PointSource
from texproj.color.sampling.gather import photo_part
from texproj.color.sampling.part import PhotoPart, Unusable
from texproj.color.sampling.prepare import depth_seen, view_of
from texproj.errors import InputError
from texproj.files import staging
from texproj.options import ColorOptions
from texproj.project import Project
from texproj.resources.threads import opencv_in_one_thread
from texproj.resources.workers import Pending, WorkerLostError
from texproj.stages.attending import NO_MEMORY, attended
from texproj.stages.bench import Crew, Workbench

POINTS = "points"
"""Where in work/ the points are, in a folder of another name for each time."""
AHEAD = 2
"""Tasks of each worker that are on their way: their results wait in its memory."""


@dataclass(frozen=True, eq=False)
class ProjectionTask:
    """A photo for a worker. points: the folder in which they are kept, within the project's; cut:
    whether what stands in front of the piece is masked.
    """

    name: str
    camera: Camera
    shift: Floats | None
    points: str
    cut: bool
    options: ColorOptions


@dataclass(frozen=True, eq=False)
class ProjectionByCrew:
    """Projects photos by workers that know the project."""

    crew: Crew
    project: Project

    def parts(
        self,
        points: PointSource,
        cameras: dict[str, Camera],
        shifts: Sequence[Floats | None],
        options: ColorOptions,
    ) -> Iterator[PhotoPart | Unusable]:
        """As `Elsewhere` has it."""
        cut = self.project.settings.color.occluders
        with _kept(points, self.project) as folder:
            self.crew.bring(folder, self.project.occluders)
            inside = str(folder.relative_to(self.project.root.resolve()))
            tasks = (
                ProjectionTask(name, camera, shift, inside, cut, options)
                for (name, camera), shift in zip(cameras.items(), shifts, strict=True)
            )
            coming: deque[tuple[str, Pending[PhotoPart | Unusable]]] = deque()
            most = AHEAD * max(self.crew.count, 1)
            for task in tasks:
                if len(coming) >= most:
                    yield _result(*coming.popleft())
                coming.append((task.name, self.crew.submit(_projected, task)))
            while coming:
                yield _result(*coming.popleft())


def _result(name: str, pending: Pending[PhotoPart | Unusable]) -> PhotoPart | Unusable:
    try:
        return pending.result(_nobody_listens)
    except WorkerLostError:
        return Unusable(name, NO_MEMORY)


def _nobody_listens() -> None:
    """After each photo there is a chance to stop."""


# --- points in a folder


@contextmanager
def _kept(points: PointSource, project: Project) -> Iterator[Path]:
    """The points in files within this block, where workers see them. Raises OutputError."""
    all_points = project.record_path(POINTS).with_suffix("").resolve()
    folder = all_points / uuid.uuid4().hex
    shutil.rmtree(all_points, ignore_errors=True)  # of a run that was killed
    try:
        with staging(folder) as place:
            _write(points, place)
        yield folder
    finally:
        shutil.rmtree(all_points, ignore_errors=True)


def _write(points: PointSource, folder: Path) -> None:
    owners, sizes = points.owners, points.sizes
    for name in ("origin", "center", "normal", "spacing"):
        np.save(folder / f"{name}.npy", getattr(owners, name))
    np.save(folder / "starts.npy", np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]))
    with (folder / "xyz").open("wb") as xyz, (folder / "owner").open("wb") as owner:
        for number in range(len(sizes)):
            chunk = points.chunk(number)
            xyz.write(np.ascontiguousarray(chunk.xyz, np.float32).data)
            owner.write(np.ascontiguousarray(chunk.owner, np.int32).data)


@dataclass(frozen=True, eq=False)
class KeptPoints:
    """Points in the files of a folder, read where they are needed."""

    folder: Path

    @cached_property
    def owners(self) -> Owners:
        names = ("origin", "center", "normal", "spacing")
        return Owners(*(np.load(self.folder / f"{name}.npy") for name in names))

    @cached_property
    def _starts(self) -> NDArray[np.int64]:
        return np.load(self.folder / "starts.npy")

    @property
    def sizes(self) -> list[int]:
        return np.diff(self._starts).tolist()

    def chunk(self, number: int) -> Chunk:
        first, end = self._starts[number : number + 2].tolist()
        xyz = np.fromfile(self.folder / "xyz", np.float32, 3 * (end - first), offset=12 * first)
        owner = np.fromfile(self.folder / "owner", np.int32, end - first, offset=4 * first)
        return Chunk(xyz.reshape(-1, 3), owner)


# --- in a worker

_OPEN: dict[tuple[str, bool], tuple[KeptPoints, PointObserver]] = {}
"""The points that this process works on, and who looks at the same of them in all photos."""


def _opened(folder: str, detail: bool) -> tuple[KeptPoints, PointObserver]:
    if (folder, detail) not in _OPEN:
        _OPEN.clear()
        points = KeptPoints(Path(folder))
        _OPEN[folder, detail] = points, PointObserver(points, 0, detail)
    return _OPEN[folder, detail]


def _projected(bench: Workbench, task: ProjectionTask) -> PhotoPart | Unusable:
    folder = str(bench.project.root / task.points)
    points, observer = _opened(folder, task.options.focus_power > 0)
    read = partial(bench.project.load_photo, task.name, cut=task.cut)
    try:
        photo = attended(task.name, read)
    except InputError as error:
        return Unusable(task.name, str(error))
    with opencv_in_one_thread():
        depth_camera, depth = depth_seen(task.camera, bench.plain_scene)
        view = view_of(photo, task.camera, depth_camera, depth, task.options)
        del photo
        return photo_part(points, replace(view, shift=task.shift), observer, task.options)
