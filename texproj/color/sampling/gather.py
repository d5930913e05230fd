"""Projection of every photo onto every point that it sees."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar

from texproj.color.points.source import PointSource
from texproj.color.sampling.part import PackedSamples, PhotoPart, Unusable
from texproj.color.sampling.sample import Samples, sample
from texproj.color.sampling.store import SampleStore
from texproj.color.sampling.view import PhotoView
from texproj.color.weights.surface import SurfaceView, surface_view
from texproj.options import ColorOptions
from texproj.resources.scratch import Scratch
from texproj.resources.threads import in_parallel

T = TypeVar("T")
Progress = Callable[[int, int], None]
"""``progress(done, total)``."""


class Observer(Protocol):
    """Looks at each view beside the projection, while it is in memory."""

    def add(self, number: int, surface: SurfaceView, view: PhotoView) -> None:
        """Note what the photo of that number shows."""


class Noting(Protocol):
    """The same in two steps, which may be done in two places."""

    def look(self, surface: SurfaceView, view: PhotoView) -> Any:
        """What there is to note of a view."""

    def note(self, number: int, noted: Any) -> None:
        """Note it of the photo of that number."""


@dataclass(frozen=True, eq=False)
class Projection:
    """The samples of all photos that could be used, and the photos that could not."""

    samples: SampleStore
    failed: tuple[Unusable, ...]


def project_views(
    points: PointSource,
    views: Iterable[PhotoView | Unusable],
    observer: Observer,
    options: ColorOptions,
    scratch: Scratch,
    progress: Callable[[int], None] = lambda _: None,
) -> Projection:
    """The samples of prepared views, each of which `observer` sees too.

    progress: called with the number of views that are done.
    """
    store, failed = SampleStore(points.sizes, scratch), []
    for number, view in enumerate(views):
        if isinstance(view, Unusable):
            failed.append(view)
        else:
            add_photo(store, observer, number, points, view, options)
        del view  # before the next one is made
        progress(number + 1)
    return Projection(store, tuple(failed))


def add_photo(
    store: SampleStore,
    observer: Observer,
    number: int,
    points: PointSource,
    view: PhotoView,
    options: ColorOptions,
) -> None:
    """Append what one photo says about every chunk of the points, and show it to the observer."""

    def look(surface: SurfaceView, view: PhotoView) -> None:
        observer.add(number, surface, view)

    _sampled(points, view, options, partial(store.add, number), look)


def photo_part(
    points: PointSource, view: PhotoView, observer: Noting, options: ColorOptions
) -> PhotoPart:
    """What one photo says about all points, for whoever gathers it."""
    parts: list[PackedSamples] = []

    def keep(chunk: int, samples: Samples) -> None:
        parts.append(PackedSamples.of(chunk, samples))

    noted = _sampled(points, view, options, keep, observer.look)
    return PhotoPart(parts, noted)


def project_parts(
    points: PointSource,
    parts: Iterable[PhotoPart | Unusable],
    observer: Noting,
    scratch: Scratch,
    progress: Callable[[int], None] = lambda _: None,
) -> Projection:
    """The samples of all photos from the parts that `photo_part` has made, in their order."""
    store, failed = SampleStore(points.sizes, scratch), []
    for number, part in enumerate(parts):
        if isinstance(part, Unusable):
            failed.append(part)
        else:
            for packed in part.samples:
                store.add(number, packed.chunk, packed.samples())
            observer.note(number, part.noted)
        progress(number + 1)
    return Projection(store, tuple(failed))


def _sampled(
    points: PointSource,
    view: PhotoView,
    options: ColorOptions,
    keep: Callable[[int, Samples], None],
    look: Callable[[SurfaceView, PhotoView], T],
) -> T:
    """Give what a photo says about each chunk to `keep`, by many threads; what `look` says."""
    surface = surface_view(points.owners, view.camera, view.depth_camera, len(view.levels), options)

    def one(chunk: int) -> None:
        samples = sample(points.chunk(chunk), surface, view)
        if samples is not None:
            keep(chunk, samples)

    with ThreadPoolExecutor(1) as beside:
        observed = beside.submit(look, surface, view)
        in_parallel(one, range(len(points.sizes)))
        return observed.result()


def counting(progress: Progress | None, total: int, before: int = 0) -> Callable[[int], None]:
    """Progress over a round of photos, of which `before` steps were done, `total` in all."""

    def tell(done: int) -> None:
        if progress:
            progress(before + done, total)

    return tell
