"""Registered photos looked at by workers that know the project, for them to be judged."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texproj.camera import Camera
from texproj.project import Project
from texproj.register.joint.overlap import Glimpse
from texproj.register.joint.session import Kept
from texproj.register.proof.agreement import WORKING_PX, Agreement, agreement
from texproj.register.proof.camps import Pair
from texproj.register.proof.through_mesh import PhotoView, made_view
from texproj.render import GBuffer
from texproj.stages.bench import Crew, Workbench

VIEWS = "views"
"""Where in work/ photos lie while they are compared, in a folder of another name for each time."""
KEPT_VIEWS = 8
"""How many of them a worker keeps in memory: a view takes 2 MB, its gradients 1 MB."""


@dataclass(frozen=True, eq=False)
class LooksByCrew:
    """As `Looks` has it. names, cameras: of the photos, by the numbers that the judge calls them;
    asked: those that will be compared in any case; folder: the name of theirs; listen: called
    several times a second; it may raise to stop the work.
    """

    crew: Crew
    names: Sequence[str]
    cameras: Sequence[Camera]
    asked: Collection[int]
    folder: str
    listen: Callable[[], None]

    def glimpses(self, most: int) -> list[Glimpse]:
        coming = [
            self.crew.submit(_glimpse, self._seen(k), most, k in self.asked)
            for k in range(len(self.names))
        ]
        return [one.result(self.listen) for one in coming]

    def agreements(self, pairs: Sequence[Pair]) -> list[Agreement]:
        coming = [self.crew.submit(_agreement, self._seen(i), self._seen(j)) for i, j in pairs]
        return [one.result(self.listen) for one in coming]

    def _seen(self, k: int) -> Seen:
        return Seen(f"{self.folder}/{k}", self.names[k], self.cameras[k])


@dataclass(frozen=True, eq=False)
class Seen:
    """A photo with its camera (full size), and where its view is kept, within the project's folder
    of views.
    """

    place: str
    name: str
    camera: Camera


@contextmanager
def views_kept(project: Project) -> Iterator[str]:
    """A name for a folder of views, which goes with this block."""
    views = _folder(project)
    shutil.rmtree(views, ignore_errors=True)  # of a run that was killed
    try:
        yield uuid.uuid4().hex
    finally:
        shutil.rmtree(views, ignore_errors=True)


def _folder(project: Project) -> Path:
    return project.record_path(VIEWS).with_suffix("")


# --- in a worker

_VIEWS: Kept[str, PhotoView] = Kept(KEPT_VIEWS)
"""The views that this process has worked with last."""


def _glimpse(bench: Workbench, seen: Seen, most: int, compared: bool) -> Glimpse:
    """What the camera sees. compared: have the photo's view, too."""
    if compared:
        _view(bench, seen)
    return Glimpse.of(seen.camera, lambda camera: _render(bench, camera), most)


def _agreement(bench: Workbench, one: Seen, other: Seen) -> Agreement:
    return agreement(0, 1, (_view(bench, one), _view(bench, other)))


def _view(bench: Workbench, seen: Seen) -> PhotoView:
    """The photo and what the mesh looks like from its camera, as one of the workers made it."""
    path = _folder(bench.project) / f"{seen.place}.npz"

    def made() -> PhotoView:
        photo = bench.project.load_photo(seen.name, WORKING_PX)
        view = made_view(photo, seen.camera, lambda camera: _render(bench, camera))
        _write(path, view)
        return view

    return _VIEWS.fetch(seen.place, lambda: _read(path, seen.camera) or made())


def _render(bench: Workbench, camera: Camera) -> GBuffer:
    return bench.plain_scene.gbuffer(camera, ("depth",))


def _write(path: Path, view: PhotoView) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}")
    with part.open("wb") as file:
        np.savez(file, gray=view.gray, depth=view.images.require("depth"), valid=view.valid)
    part.replace(path)


def _read(path: Path, camera: Camera) -> PhotoView | None:
    """A view that was written; None where there is none yet."""
    if not path.is_file():
        return None
    with np.load(path, allow_pickle=False) as kept:
        gray, depth, valid = kept["gray"], kept["depth"], kept["valid"]
    height, width = gray.shape
    return PhotoView(camera.resized(width, height), gray, GBuffer(depth=depth), valid)
