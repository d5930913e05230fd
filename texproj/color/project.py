"""Every photo onto every point that it sees."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from texproj.camera import Camera
from texproj.color.points import PointSource
from texproj.color.sample import sample
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
    progress: Progress | None = None,
) -> Spill:
    """The samples of all photos; each is loaded once and forgotten; one that loads as
    None is left out. Close the result."""
    spill = Spill(points.sizes)
    for number, camera in enumerate(cameras):
        photo = load_photo(number)
        if photo is not None:
            view = photo_view(photo, camera, scene, options)
            add_photo(spill, number, points, view, options)
        if progress:
            progress(number + 1, len(cameras))
    return spill


def add_photo(
    spill: Spill, number: int, points: PointSource, view: PhotoView, options: ColorOptions
) -> None:
    """Append what one photo says about every chunk of the points."""
    candidates = points.candidates(view.camera)

    def one(chunk: int) -> None:
        spill.add(number, chunk, sample(points.chunk(chunk, candidates), view, options))

    with ThreadPoolExecutor(workers()) as pool:
        list(pool.map(one, range(len(points.sizes))))


def workers() -> int:
    """Threads for work that numpy and OpenCV do outside of the interpreter's lock."""
    return min(os.cpu_count() or 1, 8)
