"""Ties of many pairs of photos: what is sought, photo by photo, and the search itself."""

from __future__ import annotations

import os
import uuid
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import count

import numpy as np

from texproj.arrays import Doubles, Index
from texproj.camera import Camera
from texproj.register.joint.gray import GrayPhoto
from texproj.register.joint.patches import (
    Density,
    Partner,
    Sight,
    SurfacePatches,
    find_ties,
    placed,
    seen_by,
    surface_patches,
)
from texproj.register.joint.session import Cameras, Kept, LoadPhoto, OnDisk
from texproj.register.joint.ties import PATCH_PX, TieSearch, gradient_field
from texproj.render import Render
from texproj.resources.threads import opencv_in_one_thread
from texproj.solve.joint import Ties
from texproj.solve.matching import SearchImage, SearchWindows

Pair = tuple[int, int]

KEPT_GRAY, KEPT_SIGHTS, KEPT_PATCHES = 20, 24, 12
"""How many pictures (up to 6 MB), depth images (1.5 MB) and patches of photos (up to 10 MB) stay in
memory. From disk a picture takes 2 ms, decoded again 80, a depth image drawn again 100."""
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
class Reference:
    """A camera (full size) for which something was rendered; number: another one for each."""

    camera: Camera
    number: int


@dataclass(frozen=True, eq=False)
class TieTask:
    """All pairs of photo i: which others are sought in it. It says all that its outcome depends on,
    so that it does not matter where it runs.

    finder: a word for whom it is done; chosen: for which camera the patches of i are chosen; seen:
    by partner, for which camera its depth is rendered; cameras: those of i and its partners now,
    full size.
    """

    finder: str
    i: int
    chosen: Reference
    seen: Mapping[int, Reference]
    cameras: Mapping[int, Camera]
    level: Level
    radius_px: int


Found = dict[Pair, TieSearch]
Elsewhere = Callable[[Sequence[TieTask]], Iterator[Found]]
"""What does tasks somewhere else: what each of them finds, in their order."""


class TieFinder:
    """Finds ties between photos, round by round."""

    def __init__(
        self, load_photo: LoadPhoto, render: Render, largest_px: int,
        elsewhere: Elsewhere | None = None,
    ) -> None:  # fmt: skip
        self._search = elsewhere or TieSearcher(load_photo, render, largest_px).search
        self._sight_px = sight_px(largest_px)
        self._name = uuid.uuid4().hex
        self._numbers = count()
        self._references: dict[tuple[int, int], Reference] = {}

    def find(
        self, cameras: Cameras, pairs: Sequence[Pair], level: Level, radius_px: int,
        points: Sequence[Doubles],
    ) -> Found:  # fmt: skip
        """Ties of the pairs (i, j), j sought in i, in full-size pixels. cameras: full size; points:
        by photo (n, 3) world points in its view, by which its motion is judged.
        """
        partners = defaultdict(list)
        for i, j in pairs:
            partners[i].append(j)
        for k in {k for pair in pairs for k in pair}:
            for size in {level.longest, self._sight_px}:
                self._refer(k, cameras[k], size, points[k])
        tasks = [self._task(i, others, cameras, level, radius_px) for i, others in partners.items()]
        found: Found = {}
        for part in self._search(tasks):
            found |= part
        return {pair: found[pair] for pair in pairs}

    def _task(
        self, i: int, others: Sequence[int], cameras: Cameras, level: Level, radius_px: int
    ) -> TieTask:
        seen = {j: self._references[j, self._sight_px] for j in others}
        chosen = self._references[i, level.longest]
        now = {k: cameras[k] for k in (i, *others)}
        return TieTask(self._name, i, chosen, seen, now, level, radius_px)

    def _refer(self, k: int, camera: Camera, size: int, points: Doubles) -> None:
        """What is rendered of a photo at a size is rendered anew once the photo has moved."""
        known = self._references.get((k, size))
        if known is not None:
            before, now = (c.reduced(size).project(points)[0] for c in (known.camera, camera))
            if np.nanmedian(np.linalg.norm(before - now, axis=1)) < MOVED_PX:
                return
        self._references[k, size] = Reference(camera, next(self._numbers))


def sight_px(largest_px: int) -> int:
    """Longer side of the depth images, for photos that are read at `largest_px`."""
    return min(SIGHT_PX, largest_px)


class TieSearcher:
    """Does tasks; keeps what the next of them need again."""

    def __init__(self, load_photo: LoadPhoto, render: Render, largest_px: int) -> None:
        self._load, self._render, self._largest = load_photo, render, largest_px
        self._sight_px = sight_px(largest_px)
        self._gray: OnDisk[tuple[int, int], GrayPhoto] = OnDisk(KEPT_GRAY)
        self._sights: OnDisk[tuple[int, int], Sight] = OnDisk(KEPT_SIGHTS)
        self._chosen: Kept[tuple[int, int], SurfacePatches] = Kept(KEPT_PATCHES)
        self._longest = 0

    def search(self, tasks: Sequence[TieTask]) -> Iterator[Found]:
        """What each task finds, in their order, by all processors."""
        workers = os.cpu_count() or 1
        coming: deque[Future[Found]] = deque()
        with opencv_in_one_thread(), ThreadPoolExecutor(workers) as pool:
            for task in tasks:
                if len(coming) >= workers:
                    yield coming.popleft().result()
                coming.append(pool.submit(self.prepared(task).find))
            for future in coming:
                yield future.result()

    def prepared(self, task: TieTask) -> TieJob:
        """A task with all pictures that it needs, so that any thread can do it."""
        i, level = task.i, task.level
        if level.longest != self._longest:
            self._chosen.clear()
            self._longest = level.longest
        gray = self._photo(i, level.longest)
        patches = self._patches(i, task.chosen, level)
        shown = {j: self._partner(j, task) for j in task.seen}
        return TieJob(i, task.cameras, gray, patches, shown, task.radius_px, level.density.most)

    def _photo(self, k: int, longest: int) -> GrayPhoto:
        if longest >= self._largest:
            make = partial(self._decoded, k)
        else:
            make = partial(self._reduced, k, longest)
        return self._gray.fetch((k, longest), make)

    def _decoded(self, k: int) -> GrayPhoto:
        return GrayPhoto.of(self._load(k, self._largest))

    def _reduced(self, k: int, longest: int) -> GrayPhoto:
        return self._photo(k, self._largest).reduced(longest)

    def _partner(self, k: int, task: TieTask) -> Partner:
        gray, seen = self._photo(k, task.level.longest), task.seen[k]
        sight = self._sights.fetch((k, seen.number), lambda: self._sight(k, seen, task.level))
        return Partner(task.cameras[k].resized(gray.width, gray.height), gray, sight)

    def _sight(self, k: int, seen: Reference, level: Level) -> Sight:
        """What photo k sees; patches of that size are chosen in the same picture."""
        gray = self._photo(k, self._sight_px)
        small = seen.camera.resized(gray.width, gray.height)
        images = self._render(small)
        if level.longest == self._sight_px:
            key = k, seen.number
            self._chosen.fetch(key, lambda: surface_patches(small, gray, images, level.density))
        return Sight.of(small, images, gray.mask, self._sight_px)

    def _patches(self, k: int, reference: Reference, level: Level) -> SurfacePatches:
        key = k, reference.number
        if level.longest == self._sight_px and key not in self._chosen:
            self._sights.fetch(key, lambda: self._sight(k, reference, level))
        chosen = self._chosen.fetch(key, lambda: self._choose(k, reference, level))
        return replace(chosen)  # a copy: the surface points that it makes go with it

    def _choose(self, k: int, reference: Reference, level: Level) -> SurfacePatches:
        gray = self._photo(k, level.longest)
        small = reference.camera.resized(gray.width, gray.height)
        return surface_patches(small, gray, self._render(small), level.density)


@dataclass(frozen=True, eq=False)
class TieJob:
    """All pairs of one photo, and the pictures that they need."""

    i: int
    cameras: Mapping[int, Camera]
    gray: GrayPhoto
    patches: SurfacePatches
    partners: dict[int, Partner]
    radius_px: int
    most: int

    def find(self) -> Found:
        """The ties of each partner."""
        camera = self.cameras[self.i].resized(self.gray.width, self.gray.height)
        here, inside = placed(self.patches, camera)
        seen = {j: seen_by(p, self.patches, inside, self.most) for j, p in self.partners.items()}
        searched = self._field().around(here)
        return {(self.i, j): self._ties(j, camera, which, searched) for j, which in seen.items()}

    def _field(self) -> SearchImage:
        return SearchImage.of(gradient_field(self.gray.luma()), PATCH_PX, self.radius_px)

    def _ties(self, j: int, camera: Camera, seen: Index, searched: SearchWindows) -> TieSearch:
        """Those to partner j, in pixels of the full-size photos."""
        partner = self.partners[j]
        found = find_ties((self.i, j), self.patches, seen, searched, partner)
        to, source = (self.cameras[self.i], camera), (self.cameras[j], partner.camera)
        return replace(found, ties=_at_full_size(found.ties, to, source))


def _at_full_size(ties: Ties, to: tuple[Camera, Camera], source: tuple[Camera, Camera]) -> Ties:
    """The ties in pixels of the full-size photos; to, source: (full size, reduced)."""
    return replace(
        ties, to_px=ties.to_px * _enlarged(*to), source_px=ties.source_px * _enlarged(*source)
    )


def _enlarged(full: Camera, reduced: Camera) -> Doubles:
    """(2,) full-size pixels per reduced one, across and down: sizes are whole pixels."""
    return np.array([full.width / reduced.width, full.height / reduced.height])
