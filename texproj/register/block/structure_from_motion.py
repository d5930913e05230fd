"""Structure from motion of photos alone, by COLMAP in a process of its own."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from texproj.camera import Camera, Intrinsics, Pose
from texproj.colmap.messages import (
    Batch,
    Features,
    Lens,
    Matched,
    Model,
    Picture,
    Result,
    Task,
)
from texproj.colmap.run import Listen, available, run_colmap
from texproj.errors import InputError, RegistrationError
from texproj.photo import Photo, PhotoInfo
from texproj.register.block.graph import PhotoGraph
from texproj.register.block.reconstruction import Reconstruction
from texproj.resources.workers import Pending

LONGEST_PX = 1600
"""Longer side of the photos that are compared."""
FEATURES_VERSION = 1
"""Another one for features that are found otherwise: older ones are not mixed with them."""
SOLVED_DISTORTION = 8
"""Coefficients of distortion that COLMAP's models have; a lens with more is solved anew."""

AHEAD = 2
"""Tasks of each worker that are on their way."""

LoadPhoto = Callable[[str], Photo]


@dataclass(frozen=True)
class BlockPhoto:
    """A photo of a block. key: another one for other content of photo or mask, a word of letters
    and digits; lens: the same for photos of one lens; intrinsics: its calibration, full size.
    """

    info: PhotoInfo
    key: str
    lens: str
    intrinsics: Intrinsics | None = None

    @property
    def name(self) -> str:
        return self.info.name


@dataclass(frozen=True, eq=False)
class Motion:
    """parts: photos that hang together, the part with most photos first; graph: who shows the same
    as whom; left_out: photos that no part holds, and why, one sentence each.
    """

    parts: tuple[Reconstruction, ...]
    graph: PhotoGraph
    left_out: dict[str, str]


class Elsewhere(Protocol):
    """Workers that look at photos for this process."""

    @property
    def count(self) -> int:
        """How many tasks run at once."""

    def features(self, name: str, key: str) -> Pending[Features]:
        """The features of a photo; its result raises InputError where it cannot be read."""

    def match(self, batch: Batch) -> Pending[Matched]:
        """What pairs have in common."""


def structure_from_motion(
    photos: Sequence[BlockPhoto],
    load: LoadPhoto,
    database: str,
    scratch: str,
    listen: Listen,
    elsewhere: Elsewhere | None = None,
) -> Motion:
    """The photos' places relative to each other.

    load: a photo by name, at most `LONGEST_PX` wide and high; a photo for which it raises
    InputError is left out. database: path of a file that keeps what was found of each photo and
    pair; scratch: path of an empty folder; elsewhere: who finds features and matches pairs, if not
    this machine. Raises RegistrationError where the machine or COLMAP cannot do it. The same photos
    give the same result, wherever.
    """
    if not available():
        raise RegistrationError(
            "placing photos without a start needs COLMAP: pip install pycolmap (there are packages "
            "for Linux and Windows on x86-64, and for macOS on arm64; elsewhere pick 8 points)"
        )
    first: dict[str, str] = {}
    for photo in photos:
        first.setdefault(photo.key, photo.name)
    left_out = {
        photo.name: f"it is the same as {first[photo.key]}"
        for photo in photos
        if first[photo.key] != photo.name
    }
    photos = [photo for photo in photos if photo.name not in left_out]
    ahead = 0 if elsewhere is None else AHEAD * max(1, elsewhere.count)
    task = _task(photos, database, scratch, ahead)
    names = {key: photo.name for key, photo in zip(task.keys, photos, strict=True)}

    def pictures(keys: Sequence[str]) -> Iterator[Picture | Features]:
        coming = _looked_at(keys, names, load, elsewhere, listen)
        for key, picture in zip(keys, coming, strict=True):
            if isinstance(picture, InputError):
                left_out[names[key]] = str(picture)
            else:
                yield picture

    result = run_colmap(task, pictures, listen, elsewhere.match if elsewhere else None)
    parts = tuple(_reconstruction(model, photos, task) for model in result.models)
    graph = _graph(result, photos)
    placed = {name for part in parts for name in part.names}
    alone = [name for name in names.values() if name not in placed and name not in left_out]
    return Motion(parts, graph, left_out | {name: _why_alone(name, graph) for name in alone})


def _looked_at(
    keys: Sequence[str],
    names: dict[str, str],
    load: LoadPhoto,
    elsewhere: Elsewhere | None,
    listen: Listen,
) -> Iterator[Picture | Features | InputError]:
    """Of each photo its picture, or its features where others find them, or why there is none."""
    if elsewhere is None:
        for key in keys:
            try:
                yield picture_of(key, load(names[key]))
            except InputError as error:
                yield error
        return
    coming: deque[Pending[Features]] = deque()
    ahead = AHEAD * max(1, elsewhere.count)
    for done in range(len(keys)):
        for key in keys[done + len(coming) : done + ahead]:
            coming.append(elsewhere.features(names[key], key))
        try:
            yield coming.popleft().result(partial(listen, "features", done, len(keys)))
        except InputError as error:
            yield error


def _why_alone(name: str, graph: PhotoGraph) -> str:
    near = graph.neighbors(name)
    if not near:
        return "it shows nothing that another photo shows too"
    return (
        f"it shares only {graph.count(name, near[0])} points with {near[0]} and fewer with the "
        "others, too few or too much in one plane to tell where it was taken"
    )


def _task(photos: Sequence[BlockPhoto], database: str, scratch: str, ahead: int) -> Task:
    """Photos of one lens that were taken upright and across are two lenses to COLMAP."""
    lenses: dict[tuple[str, int, int], Lens] = {}
    own = [(photo.lens, *reduced_size(photo.info)) for photo in photos]
    for lens, photo in zip(own, photos, strict=True):
        lenses.setdefault(lens, _lens(photo))
    numbers = {lens: k for k, lens in enumerate(lenses)}
    return Task(
        database=database,
        scratch=scratch,
        keys=tuple(f"{FEATURES_VERSION}-{photo.key}" for photo in photos),
        lenses=tuple(lenses.values()),
        lens_of=tuple(numbers[lens] for lens in own),
        threads=os.cpu_count() or 1,
        ahead=ahead,
    )


def _lens(photo: BlockPhoto) -> Lens:
    width, height = reduced_size(photo.info)
    calibrated = photo.intrinsics
    bent = calibrated is not None and any(calibrated.dist[SOLVED_DISTORTION:])
    if calibrated is not None and (calibrated.is_fisheye or not bent):
        return Lens(width, height, intrinsics=calibrated.resized(width, height))
    focal = photo.info.focal_px if calibrated is None else calibrated.fx
    k1 = 0.0 if calibrated is not None else (*photo.info.distortion, 0.0)[0]
    return Lens(width, height, focal and focal * width / photo.info.width, k1=k1)


def reduced_size(info: PhotoInfo) -> tuple[int, int]:
    """Width and height at which a photo is compared, as it is decoded."""
    factor = min(1.0, LONGEST_PX / max(info.width, info.height))
    return max(1, round(info.width * factor)), max(1, round(info.height * factor))


def picture_of(key: str, photo: Photo) -> Picture:
    """A photo that was reduced, as COLMAP looks at it."""
    gray = np.rint(photo.gray().clip(0, 1) * 255).astype(np.uint8)
    return Picture(key, np.ascontiguousarray(gray), photo.mask)


def _reconstruction(model: Model, photos: Sequence[BlockPhoto], task: Task) -> Reconstruction:
    placed = [photos[k] for k in model.photos]
    cameras = tuple(
        Camera(_intrinsics(photo, params), Pose(R, t))
        for photo, params, R, t in zip(placed, model.lens_params, model.R, model.t, strict=True)
    )
    order = np.argsort(model.track, kind="stable")
    sightings = np.bincount(model.track, minlength=len(model.points))
    size = np.array([(photo.info.width, photo.info.height) for photo in placed])
    scale = size / [reduced_size(photo.info) for photo in placed]
    full = (model.xy_px * scale[model.seer]).astype(np.float32)
    return Reconstruction(
        names=tuple(photo.name for photo in placed),
        cameras=cameras,
        lenses=tuple(photo.lens for photo in placed),
        points=model.points,
        error_px=model.error_px,
        angle_rad=_largest_angles(model, np.array([camera.center for camera in cameras])),
        track_starts=np.concatenate([[0], np.cumsum(sightings)]),
        observer=model.seer[order],
        xy_px=full[order],
    )


def _intrinsics(photo: BlockPhoto, params: tuple[float, float, float, float] | None) -> Intrinsics:
    if params is None:
        assert photo.intrinsics is not None
        return photo.intrinsics
    focal, cx, cy, k1 = params
    width, height = reduced_size(photo.info)
    small = Intrinsics(width, height, focal, focal, cx, cy, (k1, 0.0, 0.0, 0.0, 0.0))
    return small.resized(photo.info.width, photo.info.height)


def _largest_angles(model: Model, centers: Any) -> Any:
    """(n,) largest angle between two rays of each point, rad."""
    ray = centers[model.seer] - model.points[model.track]
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-300)
    order = np.argsort(model.track, kind="stable")
    ends = np.cumsum(np.bincount(model.track, minlength=len(model.points)))[:-1]
    smallest = [float((rays @ rays.T).min()) for rays in np.split(ray[order], ends)]
    return np.arccos(np.clip(smallest, -1, 1))


def _graph(result: Result, photos: Sequence[BlockPhoto]) -> PhotoGraph:
    names = [photo.name for photo in photos]
    pairs = (tuple(sorted((names[i], names[j]))) for i, j in result.pairs)
    matches = {(a, b): int(n) for (a, b), n in zip(pairs, result.matches, strict=True)}
    return PhotoGraph(matches, frozenset(names))
