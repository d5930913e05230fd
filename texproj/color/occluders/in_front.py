"""What stands in front of the piece, sought in all photos."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace

import cv2
import numpy as np

from texproj.arrays import Bools, Bytes, Floats
from texproj.camera import Camera, Intrinsics
from texproj.color.balance.photometry import solve_photometry
from texproj.color.balance.shared_points import PointObserver, SharedPoints
from texproj.color.occluders.cutout import Told, cut_out
from texproj.color.occluders.evidence import WITNESSES, Evidence, SurfacePoints, evidence
from texproj.color.sampling.gather import Progress, counting
from texproj.color.sampling.part import Unusable
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.sampling.prepare import DEPTH_SCALE, view_of
from texproj.color.weights.surface import surface_view
from texproj.mesh import Mesh
from texproj.opencv import opencv_places
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.render import Renderer, ideal_grid
from texproj.resources.scratch import Scratch

LONGEST = 640
"""Longer side, pixels, to which photos are reduced: fine enough for an outline, and a registration
that is off by a few pixels of the photo does not count."""

POINTS_PER_PHOTO, FEWEST_POINTS, MOST_POINTS = 2_000, 20_000, 400_000
"""Points of the surface that are compared: where few photos see all of it, one in 5 x 5 pixels."""

LOOK = ColorOptions(focus_power=0, blend="robust", clipped_weight=1.0)
"""How photos are read here: only their colors count."""


@dataclass(frozen=True, eq=False)
class Occluder:
    """What stands in front of the piece in a photo.

    free: (h, w) uint8 over the whole photo, reduced: 0 = hidden, 255 = not; share: hidden part of
    what the photo would show of the mesh.
    """

    free: Bytes
    share: float


def find_occluders(
    mesh: Mesh, photos: PhotoSet, renderer: Renderer, progress: Progress | None = None
) -> dict[str, Occluder]:
    """The occluders by the names of their photos; photos without one are not in it.

    photos: may be read reduced, to `LONGEST` or more; each is read once. Their depth images are
    rendered where they are not known. At least three photos must show a place for it to be judged.
    """
    if len(photos) <= WITNESSES:
        return {}
    with closing(Scratch()) as scratch:
        photos = photos.seen_on(mesh, renderer, scratch)
        pictures = _Pictures(scratch)
        shared, said = _compared(mesh, photos, pictures, counting(progress, len(photos)))
        found = {}
        for number, name in enumerate(photos.names):
            rows = said.rows(number)
            judged = rows.start + np.flatnonzero(said.against[rows] | said.for_[rows])
            told = Told(shared.xy_px[judged], said.against[judged], said.ratio[judged])
            if not told.enough:
                continue
            picture = pictures.read(number)
            camera = photos.cameras[number].resized(*picture.shape[1::-1])
            on_mesh = shown(camera, *photos.depth_image(number))
            hidden = cut_out(picture, on_mesh, told)
            if hidden is not None:
                share = float((hidden & on_mesh).sum() / on_mesh.sum())
                found[name] = Occluder(np.where(hidden, 0, 255).astype(np.uint8), share)
        return found


def shown(camera: Camera, depth_camera: Camera, depth: Floats) -> Bools:
    """(h, w) where a camera shows the mesh, by the depth image of a pinhole camera in its place."""
    d = depth_camera.intrinsics
    at = opencv_places(ideal_grid(camera.intrinsics) * (d.fx, d.fy) + (d.cx, d.cy))
    return np.isfinite(cv2.remap(depth, at, None, cv2.INTER_NEAREST, borderValue=np.inf))


def sparse(depth_camera: Camera, depth: Floats) -> tuple[Camera, Floats]:
    """Every n-th pixel of a depth image across and down, so that as many are left as `LONGEST`
    asks for, and the camera that sees them.
    """
    step = max(int(max(depth.shape) / (DEPTH_SCALE * LONGEST)), 1)
    first = step // 2
    part, d = np.ascontiguousarray(depth[first::step, first::step]), depth_camera.intrinsics
    off = first + 0.5 - step / 2
    k = Intrinsics(
        part.shape[1], part.shape[0], d.fx / step, d.fy / step,
        (d.cx - off) / step, (d.cy - off) / step,
    )  # fmt: skip
    return replace(depth_camera, intrinsics=k), part


class _Pictures:
    """The reduced photos on disk: decoding them again takes longer than all that is done here."""

    def __init__(self, scratch: Scratch) -> None:
        self._scratch = scratch
        self._kept: dict[int, tuple[int, tuple[int, ...]]] = {}

    def keep(self, number: int, photo: Photo) -> None:
        """Keep the photo of that number."""
        pixels = np.ascontiguousarray(photo.srgb8())
        self._kept[number] = self._scratch.append(pixels.data.cast("B")), pixels.shape

    def read(self, number: int) -> Bytes:
        """(h, w, 3) sRGB of a photo that was kept."""
        start, shape = self._kept[number]
        data = self._scratch.read(start, int(np.prod(shape)))
        return np.frombuffer(data, np.uint8).reshape(shape)


def _compared(
    mesh: Mesh, photos: PhotoSet, pictures: _Pictures, tell: Callable[[int], None]
) -> tuple[SharedPoints, Evidence]:
    """What the photos show of points all over the surface, and what others say of it; `pictures`
    keeps those that could be read.
    """
    count = min(max(FEWEST_POINTS, POINTS_PER_PHOTO * len(photos)), MOST_POINTS)
    cameras = tuple(camera.reduced(LONGEST) for camera in photos.cameras)
    points = SurfacePoints.of(mesh, _pixel(mesh, cameras), count)
    observer = PointObserver(points, len(photos), count=count)
    for number in range(len(photos)):
        photo = _reduced(photos, number)
        if photo is not None:
            pictures.keep(number, photo)
            depth_camera, depth = sparse(*photos.depth_image(number))
            view = view_of(photo, cameras[number], depth_camera, depth, LOOK)
            levels = len(view.levels)
            surface = surface_view(points.owners, view.camera, depth_camera, levels, LOOK)
            observer.add(number, surface, view)
        tell(number + 1)
    shared = observer.shared()
    return shared, evidence(shared, solve_photometry(shared, LOOK))


def _reduced(photos: PhotoSet, number: int) -> Photo | None:
    """A photo, reduced; None for one that cannot be read, which coloring will tell."""
    photo = photos.photo(number)
    return None if isinstance(photo, Unusable) else photo.reduced(LONGEST)


def _pixel(mesh: Mesh, cameras: tuple[Camera, ...]) -> float:
    """Width of a pixel of a usual camera on the mesh, mesh units."""
    return float(
        np.median([np.linalg.norm(c.center - mesh.center) / c.intrinsics.fx for c in cameras])
    )
