"""Every photo onto every point that it sees."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

from texproj.camera import Camera
from texproj.color.points.source import PointSource
from texproj.color.sampling.depth_images import Depths
from texproj.color.sampling.prepare import photo_view, view_of
from texproj.color.sampling.sample import sample
from texproj.color.sampling.store import Spill
from texproj.color.sampling.view import PhotoView
from texproj.color.weights.surface import Sight, sight_of
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.render import Scene
from texproj.resources.scratch import Scratch
from texproj.resources.threads import ahead, in_parallel

__all__ = ["LoadPhoto", "Progress", "add_photo", "project_views", "views_ahead", "views_in_turn"]

LoadPhoto = Callable[[int], Photo | None]
Progress = Callable[[int, int], None]


class Observer(Protocol):
    """Looks at each view beside the projection, while it is in memory."""

    def add(self, number: int, sight: Sight, view: PhotoView) -> None:
        """Note what the photo of that number shows."""


def views_in_turn(
    cameras: Sequence[Camera], load_photo: LoadPhoto, scene: Scene, options: ColorOptions
) -> Iterator[PhotoView | None]:
    """The view of each photo, which is loaded while the one before is worked on; None where a
    photo loads as None.
    """
    return (
        photo_view(photo, camera, scene, options) if photo is not None else None
        for photo, camera in zip(ahead(load_photo, len(cameras)), cameras, strict=True)
    )


def views_ahead(
    cameras: Sequence[Camera], load_photo: LoadPhoto, depths: Depths, options: ColorOptions
) -> Iterator[PhotoView | None]:
    """The view of each photo, one of them ahead of time; None where a photo loads as None."""

    def make(number: int) -> PhotoView | None:
        photo = load_photo(number)
        if photo is None:
            return None
        return view_of(photo, cameras[number], *depths.read(number), options)

    return ahead(make, len(cameras))


def project_views(
    points: PointSource,
    views: Iterable[PhotoView | None],
    observer: Observer,
    count: int,
    options: ColorOptions,
    scratch: Scratch,
    progress: Progress | None = None,
) -> Spill:
    """The samples of prepared views, `count` in all, each of which `observer` sees too."""
    spill = Spill(points.sizes, scratch)
    for number, view in enumerate(views):
        if view is not None:
            add_photo(spill, observer, number, points, view, options)
        del view  # before the next one is made
        if progress:
            progress(number + 1, count)
    return spill


def add_photo(
    spill: Spill,
    observer: Observer,
    number: int,
    points: PointSource,
    view: PhotoView,
    options: ColorOptions,
) -> None:
    """Append what one photo says about every chunk of the points, and show it to the observer."""
    sight = sight_of(points.owners, view.camera, view.depth_camera, len(view.levels), options)

    def one(chunk: int) -> None:
        samples = sample(points.chunk(chunk), sight, view)
        if samples is not None:
            spill.add(number, chunk, samples)

    with ThreadPoolExecutor(1) as beside:
        observed = beside.submit(observer.add, number, sight, view)
        in_parallel(one, range(len(points.sizes)))
        observed.result()
