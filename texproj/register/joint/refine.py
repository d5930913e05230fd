"""All photos together: cameras at which the photos agree with each other on the surface.

After Dellepiane et al., "Global refinement of image-to-geometry registration for color
projection", Digital Heritage 2013, with one sparse least squares over tied patches in place of
mutual information photo by photo (ours). Each photo's own registration anchors the whole in the
mesh's frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.options import RefineOptions
from texproj.register.joint.lenses import PhotoStart, shared_lenses, with_aspect
from texproj.register.joint.lone import (
    LEAST_SOUGHT,
    confirmed,
    contradicted,
    far_apart,
    sought_again,
    unconfirmed,
)
from texproj.register.joint.overlap import choose_partners, shared_views
from texproj.register.joint.patches import Density
from texproj.register.joint.refined import Refined, Solved
from texproj.register.joint.search import Elsewhere, Level, Pair, TieFinder
from texproj.register.joint.session import Cameras, LoadPhoto, anchor_points
from texproj.register.joint.ties import TieSearch
from texproj.render import Render
from texproj.solve.joint import Anchors, JointPoses, Ties
from texproj.solve.lm import LmFit, LmOptions, Loss, minimize
from texproj.solve.shared_lens import LensParameters

Tell = Callable[[int, int], None]


class TiesElsewhere(Protocol):
    """Workers that know the photos by their numbers."""

    def search(self, largest_px: int) -> Elsewhere:
        """What has them seek ties, in photos read at `largest_px`."""

    def among(self, kept: Sequence[int]) -> TiesElsewhere:
        """The same where the photos are those of the numbers `kept`, counted anew."""


FIRST_RADIUS_PX, LATER_RADIUS_PX = 8, 5
"""Search radius in the first round and once the photos are close, working pixels."""
MOST_ROUNDS, FINE_ROUNDS = 8, 2
"""Most rounds at the working size, where the cameras come to rest after five to eight, and at twice
that size."""
COARSE, FINE = Density(32, 300), Density(48, 700)
"""Patches at the working size and at twice that. At the end, of one scene from a calibrated lens:
all photos .75 px off with 300, .72 with these, .67 with 1300 in twice the time."""
MOST_TIES, LEAST_OF_PAIR = 400_000, 32
"""Patches sought of all pairs together, 130 bytes each, and of one pair nevertheless: of a thousand
photos, each compared with eight others, one still has eight hundred."""
TIE_SIGMA_PX = 0.5
"""Noise of a tie, working pixels: what well registered photos of real scenes show."""
TIE_LOSS = Loss("cauchy", 1.5)
STEPS = LmOptions(max_iterations=15, cost_tolerance=1e-5)
SETTLED_PX = 0.05
"""Motion of the surface in the photos below which the cameras have stopped, working pixels."""
ANCHOR_WEIGHT = 2.0
"""For how many independent observations a photo's own registration counts."""
ASPECT_GAIN = 0.015
"""Part of the cost that must fall for fy / fx to be solved: most sensors have square pixels, and
one more number always gains a little."""


def refine(
    photos: Sequence[PhotoStart],
    load_photo: LoadPhoto,
    render: Render,
    options: RefineOptions | None = None,
    tell: Tell = lambda done, total: None,
    elsewhere: TiesElsewhere | None = None,
) -> Refined:
    """Cameras that agree on the surface. render: gives depth and normals for a camera; tell: hears
    before each round how many are done, of how many at most; elsewhere: where ties are sought, if
    not in this process.
    """
    options = options or RefineOptions()
    cameras = tuple(photo.camera for photo in photos)
    points = anchor_points(cameras, render)
    start, shared = shared_lenses(photos, points)
    largest = 2 * options.working_px
    search = None if elsewhere is None else elsewhere.search(largest)
    finder = TieFinder(load_photo, render, largest, search)
    fixed, sigma_px = np.array([p.fixed for p in photos]), np.array([p.sigma_px for p in photos])
    joint = _Joint(cameras, start, sigma_px, fixed, shared, finder, points)
    pairs = choose_partners(*shared_views(start, render), options.partners)
    end = _settled(joint, pairs, _schedule(options, len(pairs)), tell)
    if isinstance(end, _Contradiction):
        others, reasons = _without(end, photos, finder, points, options)
        kept = [k for k in range(len(cameras)) if k not in reasons]
        rest = refine(
            [others[k] for k in kept], lambda k, size: load_photo(kept[k], size), render, options,
            tell, elsewhere and elsewhere.among(kept),
        )  # fmt: skip
        return rest.among(kept, cameras, reasons)
    if end.fit is None:
        nothing = np.full(len(cameras), np.nan)
        return Refined(start, {}, (), nothing, nothing, {"rounds": end.rounds, "pairs": len(pairs)})
    picks = {k: photo.picks for k, photo in enumerate(photos) if photo.picks is not None}
    solved = Solved(
        cameras, end.cameras, end.tied, points, fixed, end.joint.lenses, end.fit, picks
    ).outcome()
    solved.quality["agreement"]["tie_residual_working_px"] = round(
        float(np.nanmedian(np.linalg.norm(_apart_px(end.fit), axis=1))), 3
    )
    solved.quality.update(rounds=end.rounds, pairs=len(pairs))
    found_again = tuple(k for k, photo in enumerate(photos) if photo.sought_again)
    return replace(solved, found_again=found_again)


@dataclass(frozen=True, eq=False)
class _Contradiction:
    """Photos that contradict the others, why, the cameras then, and whom to ask for each's own."""

    lone: list[tuple[int, str]]
    cameras: Cameras
    partners: dict[int, tuple[int, ...]]

    @classmethod
    def of(
        cls, lone: list[tuple[int, str]], cameras: Cameras, pairs: list[Pair], right: set[int]
    ) -> _Contradiction:
        """The first of them and all that have nothing to do with it, or with each other."""
        chosen = far_apart(lone, pairs)
        return cls(chosen, cameras, {k: _partners(k, pairs, right) for k, _ in chosen})


def _without(
    end: _Contradiction, photos: Sequence[PhotoStart], finder: TieFinder, points: list[Doubles],
    options: RefineOptions,
) -> tuple[list[PhotoStart], dict[int, str]]:  # fmt: skip
    """The photos, those that contradict with what their partners found for them, and why those go
    for which nothing was found.
    """
    others, reasons = [*photos], {}
    for k, reason in end.lone:
        again: Camera | None = None
        if not photos[k].sought_again:
            where = end.cameras, end.partners[k], finder, points, options.working_px
            again = sought_again(k, *where)
        if again is None:
            reasons[k] = reason
        else:
            others[k] = _found_again(photos[k], again, options)
    return others, reasons


@dataclass(frozen=True, eq=False)
class _Settled:
    """Cameras at rest, and the last ties; fit: None where there were too few."""

    joint: _Joint
    cameras: Cameras
    tied: tuple[int, ...]
    fit: LmFit[Cameras] | None
    rounds: int


def _settled(
    joint: _Joint, pairs: list[Pair], schedule: list[tuple[Level, int]], tell: Tell
) -> _Settled | _Contradiction:
    """Rounds of searching ties and solving until the cameras rest, or one of them stands alone."""
    now, ties, fit, rounds = joint.start, Ties.none(), None, 0
    found = joint.search(now, pairs, schedule[0][0], FIRST_RADIUS_PX)
    right = confirmed(found)
    lone = unconfirmed(found, joint.fixed)
    if lone:
        return _Contradiction.of(lone, now, pairs, right)
    pairs = [(i, j) for i, j in pairs if {i, j} <= right]
    most_rounds = sum(most for _, most in schedule)
    for level, most in schedule:
        for _ in range(most if pairs else 0):
            tell(rounds, most_rounds)
            before, rounds = now, rounds + 1
            if rounds > 1:
                found = joint.search(before, pairs, level, LATER_RADIUS_PX)
            ties = Ties.joined([found[pair].ties for pair in pairs])
            if len(ties) < LEAST_SOUGHT:
                break
            now, fit = joint.solve(before, ties, level.longest)
            scale = joint.working_scale(level.longest)
            if (joint.motion_px(before, now) * scale).max() < SETTLED_PX:
                break
        if fit is not None and len(ties) >= LEAST_SOUGHT:
            apart = _apart_px(fit) * (schedule[0][0].longest / level.longest)
            lone = unconfirmed(found, joint.fixed) or contradicted(ties, apart, joint.fixed)
            if lone:
                return _Contradiction.of(lone, now, pairs, right)
            joint, now, fit = joint.with_aspect(now, ties, level.longest, fit)
    tied = tuple(int(k) for k in np.unique([ties.to, ties.source]))
    return _Settled(joint, now, tied, fit, rounds)


def _partners(k: int, pairs: list[Pair], right: set[int]) -> tuple[int, ...]:
    """The credible photos that photo k is compared with."""
    return tuple(sorted({n for pair in pairs if k in pair for n in pair} & right - {k}))


def _apart_px(fit: LmFit[Cameras]) -> Doubles:
    """(n, 2) how far ties are from where the cameras put them, pixels of the last size."""
    return fit.residual * TIE_SIGMA_PX


def _found_again(photo: PhotoStart, camera: Camera, options: RefineOptions) -> PhotoStart:
    """The photo with what the wide search has found, good to one of its pixels or two."""
    wide_px = 2 * max(1.0, max(camera.width, camera.height) / options.working_px)
    return replace(
        photo, camera=camera, sigma_px=max(photo.sigma_px, 2 * wide_px), sought_again=True
    )


def _schedule(options: RefineOptions, pairs: int) -> list[tuple[Level, int]]:
    """(working size, most rounds there)."""
    share = max(MOST_TIES // max(pairs, 1), LEAST_OF_PAIR)
    coarse, fine = (Density(d.along, min(d.most, share)) for d in (COARSE, FINE))
    return [
        (Level(options.working_px, coarse), MOST_ROUNDS),
        (Level(2 * options.working_px, fine), FINE_ROUNDS),
    ]


@dataclass(frozen=True, eq=False)
class _Joint:
    """What stays the same over all rounds; points: per camera, what its own registration saw."""

    given: Cameras
    start: Cameras
    sigma_px: Doubles
    fixed: NDArray[np.bool_]
    lenses: LensParameters
    finder: TieFinder
    points: list[Doubles]

    def working_scale(self, longest: int) -> Doubles:
        """(n,) pixels of each reduced photo per pixel of the full one."""
        return np.array([min(1.0, longest / max(c.width, c.height)) for c in self.given])

    def search(
        self, cameras: Cameras, pairs: list[Pair], level: Level, radius_px: int
    ) -> dict[Pair, TieSearch]:
        """Ties of all pairs, positions in full-size pixels."""
        return self.finder.find(cameras, pairs, level, radius_px, self.points)

    def solve(self, cameras: Cameras, joined: Ties, longest: int) -> tuple[Cameras, LmFit[Cameras]]:
        """Move all tied cameras at once."""
        sigma = TIE_SIGMA_PX / self.working_scale(longest)
        tied = np.isin(np.arange(len(cameras)), [joined.to, joined.source])
        problem = JointPoses(joined, self._anchors(), self.lenses, sigma, self.fixed | ~tied)
        fit = minimize(problem, cameras, TIE_LOSS, STEPS)
        return fit.x, fit

    def with_aspect(
        self, cameras: Cameras, joined: Ties, longest: int, fit: LmFit[Cameras]
    ) -> tuple[_Joint, Cameras, LmFit[Cameras]]:
        """This, the cameras and their fit, with fy / fx solved where the ties ask for it: pixels
        of most sensors are square, and a wrong surface is explained by others only too easily.
        """
        joint = self
        for group in range(len(self.lenses.blocks[1].value)):
            freed = replace(joint, lenses=with_aspect(joint.lenses, group))
            moved, better = freed.solve(cameras, joined, longest)
            if better.cost < (1 - ASPECT_GAIN) * fit.cost:
                joint, cameras, fit = freed, moved, better
        return joint, cameras, fit

    def motion_px(self, before: Cameras, after: Cameras) -> Doubles:
        """(n,) mean motion of the surface in each photo, full-size pixels."""
        motion = np.zeros(len(before))
        for k, points in enumerate(self.points):
            shift = after[k].project(points)[0] - before[k].project(points)[0]
            motion[k] = np.nanmean(np.linalg.norm(shift, axis=1)) if len(points) else 0
        return motion

    def _anchors(self) -> Anchors:
        count = np.array([len(p) for p in self.points])
        camera = np.repeat(np.arange(len(count)), count)
        px = [c.project(p)[0] for c, p in zip(self.given, self.points, strict=True)]
        sigma = np.repeat(self.sigma_px * np.sqrt(count / ANCHOR_WEIGHT), count)
        return Anchors(camera, np.concatenate(self.points), np.concatenate(px), sigma)
