"""Every photo onto every point that it sees."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from texproj.camera import Camera
from texproj.color.depths import Depths
from texproj.color.points import PointSource
from texproj.color.sample import sample
from texproj.color.scratch import Scratch
from texproj.color.sight import sight_of
from texproj.color.spill import Spill
from texproj.color.threads import ahead, in_parallel
from texproj.color.view import PhotoView, photo_view, view_of
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.render import Scene

__all__ = ["LoadPhoto", "Progress", "add_photo", "in_parallel", "project_depths", "project_photos"]

LoadPhoto = Callable[[int], Photo | None]
Progress = Callable[[int, int], None]


def project_photos(
    points: PointSource,
    cameras: Sequence[Camera],
    load_photo: LoadPhoto,
    scene: Scene,
    options: ColorOptions,
    scratch: Scratch,
    progress: Progress | None = None,
) -> Spill:
    """The samples of all photos; each is loaded once, while the one before is worked on, and
    forgotten; one that loads as None is left out.
    """
    views = (
        photo_view(photo, camera, scene, options) if photo is not None else None
        for photo, camera in zip(ahead(load_photo, len(cameras)), cameras, strict=True)
    )
    return project_views(points, views, len(cameras), options, scratch, progress)


def project_depths(
    points: PointSource,
    cameras: Sequence[Camera],
    load_photo: LoadPhoto,
    depths: Depths,
    options: ColorOptions,
    scratch: Scratch,
    progress: Progress | None = None,
) -> Spill:
    """The same with depth images made before, so that whole views are made ahead."""

    def make(number: int) -> PhotoView | None:
        photo = load_photo(number)
        if photo is None:
            return None
        return view_of(photo, cameras[number], *depths.read(number), options)

    views = ahead(make, len(cameras))
    return project_views(points, views, len(cameras), options, scratch, progress)


def project_views(
    points: PointSource,
    views: Iterable[PhotoView | None],
    count: int,
    options: ColorOptions,
    scratch: Scratch,
    progress: Progress | None,
) -> Spill:
    """The samples of prepared views, `count` in all."""
    spill = Spill(points.sizes, scratch)
    for number, view in enumerate(views):
        if view is not None:
            add_photo(spill, number, points, view, options)
        del view  # before the next one is made
        if progress:
            progress(number + 1, count)
    return spill


def add_photo(
    spill: Spill, number: int, points: PointSource, view: PhotoView, options: ColorOptions
) -> None:
    """Append what one photo says about every chunk of the points."""
    sight = sight_of(points.owners, view.camera, view.depth_camera, len(view.levels), options)

    def one(chunk: int) -> None:
        samples = sample(points.chunk(chunk), sight, view)
        if samples is not None:
            spill.add(number, chunk, samples)

    in_parallel(one, range(len(points.sizes)))
