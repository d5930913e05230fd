"""Ties between photos, sought by workers that know the project."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from texproj.camera import Camera
from texproj.photo import Photo
from texproj.register.joint.search import Elsewhere, Found, TieSearcher, TieTask
from texproj.render import GBuffer
from texproj.resources.workers import WorkerLostError, Workers
from texproj.stages.bench import Workbench

CHANNELS = ("depth", "normal")


@dataclass(frozen=True, eq=False)
class TiesByCrew:
    """names: of the photos, by the numbers that tasks call them."""

    crew: Workers
    names: Sequence[str]

    def among(self, kept: Sequence[int]) -> TiesByCrew:
        """The same for some of the photos, counted anew."""
        return TiesByCrew(self.crew, [self.names[k] for k in kept])

    def search(self, largest_px: int) -> Elsewhere:
        """What has the crew do tasks."""
        return partial(self._done, largest_px=largest_px)

    def _done(self, tasks: Sequence[TieTask], largest_px: int) -> Iterator[Found]:
        coming = [
            self.crew.submit(_ties, task, {k: self.names[k] for k in task.cameras}, largest_px)
            for task in tasks
        ]
        for pending in coming:
            try:
                yield pending.result(_nobody_listens)
            except WorkerLostError:  # several workers have ended at it: so would this process
                raise MemoryError from None


def _nobody_listens() -> None:
    """Between two rounds there is a chance to stop."""


# --- in a worker

_SEARCHERS: dict[str, _Searcher] = {}
"""The searcher of the finder for whom this process has worked last."""


class _Searcher:
    """A searcher that learns the names of photos with each task."""

    def __init__(self, bench: Workbench, largest_px: int) -> None:
        self.bench = bench
        self._names: dict[int, str] = {}
        self._searcher = TieSearcher(self._load, self._render, largest_px)

    def find(self, task: TieTask, names: Mapping[int, str]) -> Found:
        """What a task finds."""
        self._names.update(names)
        return self._searcher.prepared(task).find()

    def _load(self, number: int, longest: int) -> Photo:
        return self.bench.project.load_photo(self._names[number], longest)

    def _render(self, camera: Camera) -> GBuffer:
        return self.bench.plain_scene.gbuffer(camera, CHANNELS)


def _ties(bench: Workbench, task: TieTask, names: Mapping[int, str], largest_px: int) -> Found:
    known = _SEARCHERS.get(task.finder)
    if known is None or known.bench is not bench:
        _SEARCHERS.clear()
        _SEARCHERS[task.finder] = known = _Searcher(bench, largest_px)
    return known.find(task, names)
