"""All photos together: cameras at which the photos agree with each other on the surface.

After Dellepiane et al., "Global refinement of image-to-geometry registration for color
projection", Digital Heritage 2013, with one sparse least squares over tied patches in place of
mutual information photo by photo (ours). Each photo's own registration anchors the whole in the
mesh's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.options import RefineOptions
from texproj.register.joint.lenses import PhotoStart, shared_lenses, with_aspect
from texproj.register.joint.overlap import choose_partners, shared_views
from texproj.register.joint.patches import Density
from texproj.register.joint.search import Level, TieFinder
from texproj.register.joint.session import Cameras, LoadPhoto, anchor_points
from texproj.register.joint.ties import TieSearch
from texproj.render import Render
from texproj.solve.joint import Anchors, JointPoses, Ties
from texproj.solve.lm import LmFit, LmOptions, Loss, minimize
from texproj.solve.reprojection import projection_jacobian
from texproj.solve.shared_lens import LensParameters

Pair = tuple[int, int]

FIRST_RADIUS_PX, LATER_RADIUS_PX = 8, 5
"""Search radius in the first round and once the photos are close, working pixels."""
MOST_ROUNDS, FINE_ROUNDS = 8, 2
"""Most rounds at the working size, where the cameras come to rest after five to eight, and at twice
that size."""
COARSE, FINE = Density(32, 300), Density(48, 700)
"""Patches at the working size and at twice that: with fewer at the end the place of all photos on
the mesh is less sure (.75 px in place of .65 with 300), with more only the time grows."""
LEAST_SUPPORT = 0.15
"""A photo is thrown out if no partner confirms at least this share of its patches."""
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
LEAST_SOUGHT = 20
"""Patches sought, or ties, below which nothing is concluded."""
TIE_CORRELATION = 20.0
"""How many ties share an error (shape of the mesh, light); widens the expected error."""
SYSTEMATIC_PX = 0.2
"""What more ties do not remove, working pixels: with thousands of ties a photo, two real scenes
with known cameras end at 0.6 .. 0.8 full pixels of 2832 and 3072, whatever the covariance says."""


@dataclass(frozen=True, eq=False)
class Refined:
    """Cameras that were brought to agree with each other on the surface.

    cameras: full size, as given where nothing could be said; thrown_out: why, by number, for
    those that contradict the others; tied: numbers of those that were solved;
    expected_error_px, motion_px: (n,) full-size pixels, NaN where not solved; quality: for the
    report.
    """

    cameras: Cameras
    thrown_out: dict[int, str]
    tied: tuple[int, ...]
    expected_error_px: Doubles
    motion_px: Doubles
    quality: dict[str, Any] = field(default_factory=dict)


def refine(
    photos: Sequence[PhotoStart],
    load_photo: LoadPhoto,
    render: Render,
    options: RefineOptions | None = None,
) -> Refined:
    """Cameras that agree on the surface. render: gives depth and normals for a camera."""
    options = options or RefineOptions()
    cameras = tuple(photo.camera for photo in photos)
    points = anchor_points(cameras, render)
    start, shared = shared_lenses(photos, points)
    joint = _Joint(
        cameras, start, np.array([photo.sigma_px for photo in photos]),
        np.array([photo.fixed for photo in photos]), shared,
        TieFinder(load_photo, render, 2 * options.working_px), points,
    )  # fmt: skip
    pairs = choose_partners(*shared_views(start, render), options.partners)
    found = joint.search(start, pairs, _schedule(options)[0][0], FIRST_RADIUS_PX)
    unconfirmed = joint.unconfirmed(found, options)
    if unconfirmed:
        kept = [k for k in range(len(cameras)) if k not in unconfirmed]
        rest = refine(
            [photos[k] for k in kept], lambda k, size: load_photo(kept[k], size), render, options
        )
        return _with_unconfirmed(rest, kept, joint.given, unconfirmed)
    confirmed = joint.confirmed(found, options)
    pairs = [(i, j) for i, j in pairs if {i, j} <= confirmed]
    now, fit, rounds = start, None, 0
    for level, most in _schedule(options):
        longest = level.longest
        for _ in range(most if pairs else 0):
            before, rounds = now, rounds + 1
            if rounds > 1:
                found = joint.search(before, pairs, level, LATER_RADIUS_PX)
            ties = Ties.joined([found[pair].ties for pair in pairs])
            if len(ties) < LEAST_SOUGHT:
                break
            now, fit = joint.solve(before, ties, longest)
            if (joint.motion_px(before, now) * joint.working_scale(longest)).max() < SETTLED_PX:
                break
        if fit is not None and len(ties) >= LEAST_SOUGHT:
            joint, now, fit = joint.with_aspect(now, ties, longest, fit)
    tied = tuple(int(k) for k in np.unique([ties.to, ties.source])) if fit else ()
    numbers: dict[str, Any] = {"rounds": rounds, "pairs": len(pairs)}
    if fit is not None:
        apart = np.linalg.norm(fit.residual, axis=1) * TIE_SIGMA_PX
        numbers["tie_residual_working_px"] = float(np.nanmedian(apart))
    return joint.outcome(now, tied, fit, numbers, options.working_px)


def _schedule(options: RefineOptions) -> list[tuple[Level, int]]:
    """(working size, most rounds there)."""
    return [
        (Level(options.working_px, COARSE), MOST_ROUNDS),
        (Level(2 * options.working_px, FINE), FINE_ROUNDS),
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

    def unconfirmed(self, found: dict[Pair, TieSearch], options: RefineOptions) -> dict[int, str]:
        """The photo whose surface no partner confirms, if its partners are credible: another photo
        confirms one of them. One at a time, the least confirmed first.
        """
        best = _best_support(found)
        credible = self.confirmed(found, options)
        suspects = [
            k for k in best
            if k not in credible and not self.fixed[k]
            and any(k in pair and credible & set(pair) for pair in found)
        ]  # fmt: skip
        if not suspects:
            return {}
        worst = min(suspects, key=lambda k: best[k])
        return {
            worst: "no other photo shows the same surface where this camera sees it (at best "
            f"{best[worst]:.0%} of the patches agree); check its picks or its start"
        }

    def confirmed(self, found: dict[Pair, TieSearch], options: RefineOptions) -> set[int]:
        """Photos of which at least one partner shows the same surface at the same place."""
        return {k for k, share in _best_support(found).items() if share >= LEAST_SUPPORT}

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

    def outcome(
        self, cameras: Cameras, tied: tuple[int, ...], fit: LmFit[Cameras] | None,
        quality: dict[str, Any], longest: int,
    ) -> Refined:  # fmt: skip
        """The result with its expected errors."""
        error, motion = np.full(len(cameras), np.nan), np.full(len(cameras), np.nan)
        if fit is not None:
            systematic_px = SYSTEMATIC_PX / self.working_scale(longest)
            covariance = fit.covariance(max(fit.scatter2, 0.1) * TIE_CORRELATION)
            for k in tied:
                block = covariance[6 * k : 6 * k + 6, 6 * k : 6 * k + 6]
                spread = _spread_px(cameras[k], self.points[k], block)
                error[k] = 0.0 if self.fixed[k] else float(np.hypot(spread, systematic_px[k]))
            quality["focal_px"] = [round(c.intrinsics.fx, 2) for c in cameras]
            motion = np.where(
                np.isin(np.arange(len(motion)), tied), self.motion_px(self.given, cameras), np.nan
            )
            quality["ties"] = len(fit.residual)
        return Refined(cameras, {}, tied, error, motion, quality)

    def _anchors(self) -> Anchors:
        count = np.array([len(p) for p in self.points])
        camera = np.repeat(np.arange(len(count)), count)
        px = [c.project(p)[0] for c, p in zip(self.given, self.points, strict=True)]
        sigma = np.repeat(self.sigma_px * np.sqrt(count / ANCHOR_WEIGHT), count)
        return Anchors(camera, np.concatenate(self.points), np.concatenate(px), sigma)


def _best_support(found: dict[Pair, TieSearch]) -> dict[int, float]:
    """By photo, the largest share of patches that a partner confirms; photos of which too little
    could be sought are not in it.
    """
    best: dict[int, float] = {}
    for pair, search in found.items():
        if search.sought >= LEAST_SOUGHT:
            for k in pair:
                best[k] = max(best.get(k, 0.0), search.support)
    return best


def _with_unconfirmed(
    rest: Refined, kept: list[int], given: Cameras, unconfirmed: dict[int, str]
) -> Refined:
    """The result of the others among all cameras: what is unconfirmed changes nothing of it."""
    cameras, nothing = list(given), np.full(len(given), np.nan)
    error, motion = nothing.copy(), nothing.copy()
    for position, k in enumerate(kept):
        cameras[k] = rest.cameras[position]
        error[k], motion[k] = rest.expected_error_px[position], rest.motion_px[position]
    thrown_out = {**unconfirmed, **{kept[k]: why for k, why in rest.thrown_out.items()}}
    tied = tuple(kept[k] for k in rest.tied)
    return Refined(tuple(cameras), thrown_out, tied, error, motion, rest.quality)


def _spread_px(camera: Camera, points: Doubles, covariance: Doubles) -> float:
    """Root mean square image deviation of the surface under the pose's covariance; infinite where
    that says nothing.
    """
    if not np.isfinite(covariance).all():
        return float("inf")
    jacobian = projection_jacobian(camera, points)
    variance = jacobian @ covariance @ jacobian.transpose(0, 2, 1)
    return float(np.sqrt(np.trace(variance, axis1=1, axis2=2).mean()))
