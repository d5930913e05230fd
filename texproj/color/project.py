"""Every photo onto every point that it sees."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from texproj.camera import Camera
from texproj.color.points import SurfacePoints, chunks
from texproj.color.sample import sample
from texproj.color.spill import Spill
from texproj.color.view import DepthScene, PhotoView, photo_view
from texproj.options import ColorOptions
from texproj.photo import Photo

LoadPhoto = Callable[[int], Photo]
Progress = Callable[[int, int], None]


def project_photos(
    points: SurfacePoints,
    cameras: Sequence[Camera],
    load_photo: LoadPhoto,
    scene: DepthScene,
    options: ColorOptions,
    progress: Progress | None = None,
) -> Spill:
    """The samples of all photos; each is loaded once and forgotten. Close the result."""
    parts = list(chunks(len(points)))
    spill = Spill([part.stop - part.start for part in parts])
    for number, camera in enumerate(cameras):
        view = photo_view(load_photo(number), camera, scene, options)
        add_photo(spill, number, points, view, options)
        if progress:
            progress(number + 1, len(cameras))
    return spill


def add_photo(
    spill: Spill, number: int, points: SurfacePoints, view: PhotoView, options: ColorOptions
) -> None:
    """Append what one photo says about every chunk of the points."""
    for chunk, part in enumerate(chunks(len(points))):
        spill.add(number, chunk, sample(points.at(part), view, options))
