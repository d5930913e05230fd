"""The search for the camera from which the mesh tells most about a photo: coarse to fine, a
rendering for each round, and steps in pixels of image motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.options import MutualInformationOptions
from texproj.photo import Correspondences, Photo
from texproj.register.information.comparison import Comparison, PhotoLevel
from texproj.register.motion import motion_px
from texproj.render import Render
from texproj.solve.lm import FAR, Loss
from texproj.solve.pose_search import CameraSteps, Found, maximize

PROBES = 300
INDEPENDENT_PX = 12.0
"""Distance, pixels of a level, at which two samples tell something of their own: shading changes
from one part of the surface to the next, not from pixel to pixel."""
PICK_SCALE = 3.0
"""Cauchy scale of picks in their standard deviations: a gross error must not decide."""


@dataclass(frozen=True)
class Round:
    """One search at one size: part of the working size, first and last step and reach in its
    pixels, evaluations; spread: distance at which other starts are tried first, 0 = none.
    """

    size: float
    first: float
    last: float
    reach: float
    evaluations: int
    spread: float = 0.0


COARSE = (Round(0.25, 4, 0.2, 25, 100, spread=5.0), Round(0.25, 1.5, 0.2, 10, 60))
MIDDLE = (Round(0.5, 2, 0.1, 12, 80),)
FINE = Round(1.0, 1.5, 0.05, 8, 90)
STILL = 0.0004
"""Motion, as a share of the width, below which a further fine round is not worth it."""
MOST_FINE = 4
SCATTERED, FOLLOWED = 120, 2
"""Places tried around the start, and how many of the best are followed."""


@dataclass(frozen=True, eq=False)
class Task:
    """One photo to be registered, with all that stays the same meanwhile."""

    photo: Photo
    render: Render
    options: MutualInformationOptions
    picks: Correspondences | None = None

    def comparison(self, camera: Camera, size: float) -> Comparison | None:
        """At a part of the working size; None if too little of the mesh is in view."""
        longest = size * min(self.options.working_px, max(self.photo.width, self.photo.height))
        level = PhotoLevel.of(self.photo, camera, longest, self.options.gradients)
        return Comparison.at(level, self.render, self.options, exact=size >= 1)


@dataclass(frozen=True, eq=False)
class Outcome:
    """Where a search has come.

    camera: full size; information: bits at its end; evaluations: so far.
    """

    camera: Camera
    information: float
    evaluations: int


def objective(
    task: Task, comparison: Comparison, steps: CameraSteps, full: Camera
) -> Callable[[Doubles], float]:
    """Log likelihood, nats, of the camera a step away from `full` (full size), up to a constant."""
    certain = np.log(2) * independent_samples(comparison)

    def value(step_px: Doubles) -> float:
        likelihood = certain * comparison.information(steps.at(step_px))
        if task.picks is None:
            return likelihood
        return likelihood - _pick_cost(task, moved(full, steps, step_px))

    return value


def independent_samples(comparison: Comparison) -> float:
    """How many samples of the foreground tell something of their own."""
    return max(1.0, comparison.area_px / INDEPENDENT_PX**2)


def _pick_cost(task: Task, camera: Camera) -> float:
    """Half the robust sum of squares of the picks' errors in standard deviations."""
    assert task.picks is not None
    info = task.photo.info
    sigma = task.options.pick_sigma_percent / 100 * max(info.width, info.height)
    gap = camera.project(task.picks.xyz_in_world)[0] - task.picks.xy_px
    squared = np.nan_to_num((gap**2).sum(axis=1) / sigma**2, nan=FAR**2)
    return float(0.5 * Loss("cauchy", PICK_SCALE).cost(np.minimum(squared, FAR**2)).sum())


def ascend(task: Task, camera: Camera, rounds: Sequence[Round]) -> Outcome:
    """Uphill from `camera` (full size), rendering anew for each round."""
    found = Outcome(camera, -np.inf, 0)
    for turn in rounds:
        comparison = task.comparison(found.camera, turn.size)
        if comparison is None:
            return found
        found = _climbed(task, comparison, found, turn)
    return found


def _climbed(task: Task, comparison: Comparison, here: Outcome, turn: Round) -> Outcome:
    points = comparison.points[:: max(1, len(comparison.points) // PROBES)]
    steps = CameraSteps.around(comparison.camera, points, task.options.focal)
    value = objective(task, comparison, steps, here.camera)
    starts = _spread_starts(value, steps.count, turn.spread) if turn.spread else []
    tries = [_search(value, np.zeros(steps.count), turn)]
    tries += [_search(value, start, turn) for start in starts]
    best = max(tries, key=lambda t: t.value)
    camera = moved(here.camera, steps, best.x)
    used = here.evaluations + sum(t.evaluations for t in tries)
    return Outcome(camera, comparison.information(steps.at(best.x)), used)


def moved(camera: Camera, steps: CameraSteps, step_px: Doubles) -> Camera:
    """The full camera, lens and all, moved as the pinhole camera of `steps` is."""
    end, k = steps.at(step_px), camera.intrinsics
    zoom = end.intrinsics.fx / steps.camera.intrinsics.fx
    return Camera(replace(k, fx=k.fx * zoom, fy=k.fy * zoom), end.pose)


def _search(value: Callable[[Doubles], float], start: Doubles, turn: Round) -> Found:
    found = maximize(
        lambda x: value(start + x), len(start), turn.first, turn.last, turn.evaluations, turn.reach
    )
    return replace(found, x=start + found.x)


def _spread_starts(value: Callable[[Doubles], float], count: int, spread: float) -> list[Doubles]:
    """The best of random places around 0, `spread` pixels away."""
    rng = np.random.default_rng(0)
    places = rng.standard_normal((SCATTERED, count)) * spread / np.sqrt(2)
    worth = np.array([value(place) for place in places])
    return [places[i] for i in np.argsort(-worth)[:FOLLOWED]]


def settled(task: Task, found: Outcome) -> Outcome:
    """Fine rounds until the camera stays where it is."""
    for _ in range(MOST_FINE):
        before = found.camera
        comparison = task.comparison(before, FINE.size)
        if comparison is None:
            return found
        found = _climbed(task, comparison, found, FINE)
        if motion_px(found.camera, before, comparison.points[::40]) < STILL * before.width:
            break
    return found
