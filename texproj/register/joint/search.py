"""Ties of many pairs of photos, with one photo's pictures at a time and all processors."""

from __future__ import annotations

import os
from collections import defaultdict, deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.register.joint.gray import GrayPhoto
from texproj.register.joint.patches import (
    Density,
    Partner,
    Sight,
    SurfacePatches,
    find_ties,
    surface_patches,
)
from texproj.register.joint.session import Cameras, Kept, LoadPhoto
from texproj.register.joint.ties import PATCH_PX, TieSearch, gradient_field
from texproj.render import Render
from texproj.resources.threads import opencv_in_one_thread
from texproj.solve.joint import Ties
from texproj.solve.matching import SearchImage

Pair = tuple[int, int]

KEPT_GRAY, KEPT_SIGHTS, KEPT_PATCHES = 48, 48, 24
"""Of how many photos the luma (4 MB), the depth (1.5 MB) and the patches (5 MB) stay in memory."""
SIGHT_PX = 768
"""Longer side of the depth images that tell what a photo sees."""
MOVED_PX = 3.0
"""Motion of the surface, working pixels, from which on a photo's patches are chosen anew: they lie
on the mesh in any case, but no longer where the photo has its corners."""


@dataclass(frozen=True)
class Level:
    """A working size: longer side of the reduced photos, pixels; patches there."""

    longest: int
    density: Density


@dataclass(frozen=True, eq=False)
class _Chosen:
    """Patches of a photo and the camera (full size) for which they were chosen."""

    camera: Camera
    patches: SurfacePatches


class TieFinder:
    """Finds ties between photos; keeps what the next round needs again."""

    def __init__(self, load_photo: LoadPhoto, render: Render, largest_px: int) -> None:
        self._load, self._render, self._largest = load_photo, render, largest_px
        self._gray: Kept[tuple[int, int], GrayPhoto] = Kept(2 * KEPT_GRAY)
        self._sights: Kept[int, Sight] = Kept(KEPT_SIGHTS)
        self._chosen: Kept[tuple[int, int], _Chosen] = Kept(KEPT_PATCHES)

    def find(
        self, cameras: Cameras, pairs: Sequence[Pair], level: Level, radius_px: int,
        points: Sequence[Doubles],
    ) -> dict[Pair, TieSearch]:  # fmt: skip
        """Ties of the pairs (i, j), j sought in i, in full-size pixels. cameras: full size; points:
        by photo (n, 3) world points in its view, by which its motion is judged.
        """
        longest = level.longest
        partners = defaultdict(list)
        for i, j in pairs:
            partners[i].append(j)
        found: dict[Pair, TieSearch] = {}
        workers = os.cpu_count() or 1
        coming: deque[Future[dict[Pair, TieSearch]]] = deque()
        with opencv_in_one_thread(), ThreadPoolExecutor(workers) as pool:
            for i, others in partners.items():
                if len(coming) >= workers:
                    found |= coming.popleft().result()
                gray = self._photo(i, longest)
                patches = self._patches(i, cameras, level, points[i])
                shown = {j: self._partner(j, cameras, longest) for j in others}
                job = _Job(i, cameras, gray, patches, shown, radius_px, level.density.most)
                coming.append(pool.submit(job.find))
            for future in coming:
                found |= future.result()
        return {pair: found[pair] for pair in pairs}

    def _photo(self, k: int, longest: int) -> GrayPhoto:
        whole = self._gray.fetch(
            (k, self._largest), lambda: GrayPhoto.of(self._load(k, self._largest))
        )
        return self._gray.fetch((k, longest), lambda: whole.reduced(longest))

    def _partner(self, k: int, cameras: Cameras, longest: int) -> Partner:
        gray = self._photo(k, longest)
        sight = self._sights.fetch(k, lambda: self._sight(k, cameras[k]))
        return Partner(cameras[k].resized(gray.width, gray.height), gray, sight)

    def _sight(self, k: int, camera: Camera) -> Sight:
        gray = self._photo(k, SIGHT_PX)
        small = camera.resized(gray.width, gray.height)
        return Sight.of(small, self._render(small), gray.mask, SIGHT_PX)

    def _patches(self, k: int, cameras: Cameras, level: Level, points: Doubles) -> SurfacePatches:
        longest = level.longest
        known = self._chosen.get((k, longest))
        if known is not None:
            small = known.camera.reduced(longest)
            shift = small.project(points)[0] - cameras[k].reduced(longest).project(points)[0]
            if not np.nanmedian(np.linalg.norm(shift, axis=1)) < MOVED_PX:
                del self._chosen[k, longest]
        chosen = self._chosen.fetch((k, longest), lambda: self._choose(k, cameras[k], level))
        return replace(chosen.patches)  # a copy: the surface points that it makes go with it

    def _choose(self, k: int, camera: Camera, level: Level) -> _Chosen:
        gray = self._photo(k, level.longest)
        small = camera.resized(gray.width, gray.height)
        images = self._render(small)
        self._sights[k] = Sight.of(small, images, gray.mask, SIGHT_PX)
        return _Chosen(camera, surface_patches(small, gray, images, level.density))


@dataclass(frozen=True, eq=False)
class _Job:
    """All pairs of one photo."""

    i: int
    cameras: Cameras
    gray: GrayPhoto
    patches: SurfacePatches
    partners: dict[int, Partner]
    radius_px: int
    most: int

    def find(self) -> dict[Pair, TieSearch]:
        """The ties of each partner."""
        searched = SearchImage.of(gradient_field(self.gray.luma()), PATCH_PX, self.radius_px)
        full = self.cameras[self.i]
        camera = full.resized(self.gray.width, self.gray.height)
        found = {}
        for j, partner in self.partners.items():
            one = find_ties((self.i, j), self.patches, camera, searched, partner, self.most)
            to, source = (full, camera), (self.cameras[j], partner.camera)
            found[self.i, j] = replace(one, ties=_at_full_size(one.ties, to, source))
        return found


def _at_full_size(ties: Ties, to: tuple[Camera, Camera], source: tuple[Camera, Camera]) -> Ties:
    """The ties in pixels of the full-size photos; to, source: (full size, reduced)."""
    return replace(
        ties, to_px=ties.to_px * _enlarged(*to), source_px=ties.source_px * _enlarged(*source)
    )


def _enlarged(full: Camera, reduced: Camera) -> Doubles:
    """(2,) full-size pixels per reduced one, across and down: sizes are whole pixels."""
    return np.array([full.width / reduced.width, full.height / reduced.height])
