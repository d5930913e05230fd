"""Every photo onto every point that it sees."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

from texproj.camera import Camera
from texproj.color.points import PointSource
from texproj.color.sample import sample
from texproj.color.scratch import Scratch
from texproj.color.sight import sight_of
from texproj.color.spill import Spill
from texproj.color.view import PhotoView, photo_view
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.render import Scene

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
    spill = Spill(points.sizes, scratch)
    with ThreadPoolExecutor(1) as loader:
        ahead = loader.submit(load_photo, 0) if cameras else None
        for number, camera in enumerate(cameras):
            assert ahead is not None
            photo = ahead.result()
            if number + 1 < len(cameras):
                ahead = loader.submit(load_photo, number + 1)
            if photo is not None:
                view = photo_view(photo, camera, scene, options)
                del photo
                add_photo(spill, number, points, view, options)
            if progress:
                progress(number + 1, len(cameras))
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


def in_parallel(work: Callable[[int], None], numbers: Iterable[int]) -> None:
    """Call `work` in threads: numpy and OpenCV leave the interpreter's lock alone."""
    with ThreadPoolExecutor(min(os.cpu_count() or 1, 8)) as pool:
        for _ in pool.map(work, numbers):
            pass
