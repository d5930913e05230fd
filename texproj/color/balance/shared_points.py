"""What all photos say about some points spread over the surface: the evidence from which
photometric corrections are solved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.balance.sharpness import Detail, DetailMeter
from texproj.color.points.source import Chunk, PointSource, spread_points
from texproj.color.sampling.pixel_lookup import depth_pixels, photo_pixels
from texproj.color.sampling.sample import sample
from texproj.color.sampling.view import WHITE, PhotoView
from texproj.color.weights.surface import SurfaceView
from texproj.photo import PhotoInfo

COMPARED = 20_000
"""Points that are looked at."""

MOST_OBSERVATIONS = 400_000
"""Observations that are kept; every second point is dropped when there are more."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A photo that took part: its camera (of the decoded size), and what its header says."""

    camera: Camera
    info: PhotoInfo | None


@dataclass(frozen=True, eq=False)
class SharedPoints:
    """m observations of points by photos, in the order of the photos, then of the points.

    shots: one per photo, None for one that could not be had; points: how many there are;
    photo, point: (m,) int32 who saw what; rgb: (m, 3) float32 linear light as the photo shows it;
    weight: (m,) float32 as in `Samples`; xy_px: (m, 2) float32 where in the decoded photo, from
    its top-left corner; detail: how finely the photos show the surface, None if not measured.
    """

    shots: tuple[Shot | None, ...]
    points: int
    photo: NDArray[np.int32]
    point: NDArray[np.int32]
    rgb: Floats
    weight: Floats
    xy_px: Floats
    detail: Detail | None = None


@dataclass(frozen=True, eq=False)
class _Seen:
    """What one photo shows: (k,) points and (k, 6) rgb, weight, xy_px."""

    point: NDArray[np.int32]
    values: Floats

    def thinned(self, step: int) -> _Seen:
        kept = self.point % step == 0
        return _Seen(self.point[kept], self.values[kept])


@dataclass(frozen=True, eq=False)
class _Noted:
    """What one photo shows. detail: how sharp it is, None if that was not measured."""

    shot: Shot
    seen: _Seen
    detail: Detail | None


class PointObserver:
    """Looks at the same points in one photo after the other.

    The number of observations stays below `MOST_OBSERVATIONS` whatever the number of photos.
    """

    def __init__(
        self, points: PointSource, photos: int, detail: bool = False, count: int = COMPARED
    ) -> None:
        """`photos`: how many there are in all; detail: whether to measure how sharp they are;
        count: about so many of the points are looked at.
        """
        self._meter = DetailMeter(points) if detail else None
        self._chunk = spread_points(points, count)
        self._step = 1
        self._shots: list[Shot | None] = [None] * photos
        self._seen: list[_Seen | None] = [None] * photos

    def add(self, number: int, surface: SurfaceView, view: PhotoView) -> None:
        """Note what a photo shows."""
        self.note(number, self.look(surface, view))

    def look(self, surface: SurfaceView, view: PhotoView) -> _Noted:
        """What a photo shows."""
        detail = self._meter.look(surface, view) if self._meter else None
        shot = Shot(view.camera, view.info)
        return _Noted(shot, observed(self._chunk, surface, view), detail)

    def note(self, number: int, noted: _Noted) -> None:
        """Keep what the photo of that number shows."""
        if self._meter and noted.detail is not None:
            self._meter.note(number, noted.detail)
        self._shots[number] = noted.shot
        self._seen[number] = noted.seen.thinned(self._step)
        while sum(len(seen.point) for seen in self._seen if seen) > MOST_OBSERVATIONS:
            self._step *= 2
            self._seen = [seen and seen.thinned(self._step) for seen in self._seen]

    def shared(self) -> SharedPoints:
        """All that was noted."""
        seen = [part or _nothing() for part in self._seen]
        photo = np.repeat(np.arange(len(seen), dtype=np.int32), [len(s.point) for s in seen])
        point = np.concatenate([_nothing().point, *(s.point for s in seen)])
        values = np.concatenate([_nothing().values, *(s.values for s in seen)])
        return SharedPoints(
            tuple(self._shots), len(self._chunk), photo, point,
            values[:, :3], values[:, 3], values[:, 4:],
            self._meter.detail() if self._meter else None,
        )  # fmt: skip


def _nothing() -> _Seen:
    return _Seen(np.zeros(0, np.int32), np.zeros((0, 6), np.float32))


def observed(chunk: Chunk, surface: SurfaceView, view: PhotoView) -> _Seen:
    """What the photo shows of the points."""
    samples = sample(chunk, surface, view)
    if samples is None:
        return _nothing()
    point = np.flatnonzero(samples.seen)
    in_depth, _ = depth_pixels(chunk.xyz[point], surface.origin, view.depth_camera)
    values = np.empty((len(point), 6), np.float32)
    np.multiply(samples.rgb, np.float32(1 / WHITE), out=values[:, :3])
    values[:, 3] = samples.weight
    values[:, 4:] = photo_pixels(in_depth, view).reshape(-1, 2)[: len(point)] + np.float32(0.5)
    return _Seen(point.astype(np.int32), values)
