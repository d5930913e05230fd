"""The search for the camera that picks see, whatever is known of the lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.camera import Camera, Pose
from texproj.options import PointsOptions
from texproj.photo import Correspondences, PhotoInfo
from texproj.register.picks.lens import Lens
from texproj.solve.lm import LmOptions, Loss, minimize
from texproj.solve.pnp import MsacOptions, sampled_poses
from texproj.solve.reprojection import Reprojection
from texproj.solve.robust import Estimate, Noise, robust_estimate

GROSS = 0.015
"""A pick further off than this part of the longer side is wrong, whatever the noise."""

SEED = 0
"""Of the random samples, so that the same picks give the same camera."""
SAMPLES = (600, 120)
"""Three-point samples at a known focal length, and at each one of a search over focal lengths."""

PER_LENS = 3
"""Poses that each focal length passes on."""

FINALISTS = 5
"""Cameras that are worked out in full."""

DISTINCT_RAD = 0.06
"""Cameras turned by more than this against each other are two answers."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A camera worked out, and the lens model under which it was."""

    lens: Lens
    estimate: Estimate

    @property
    def length(self) -> float:
        """Description length; half a difference is the log of the odds between two candidates."""
        return self.estimate.length


@dataclass(frozen=True, eq=False)
class Search:
    """One photo's picks, and how to search. start: a pose to try as well."""

    info: PhotoInfo
    picks: Correspondences
    options: PointsOptions
    start: Pose | None = None

    @property
    def side(self) -> int:
        return max(self.info.width, self.info.height)

    @property
    def noise(self) -> Noise:
        nominal = self.options.pick_sigma_percent / 100 * self.side
        return Noise(nominal, GROSS * self.side, self.info.width * self.info.height)

    def problem(self, lens: Lens) -> Reprojection:
        """The least-squares problem of all picks."""
        return Reprojection(self.picks.xy_px, self.picks.xyz_in_world, 1.0, lens.free, lens.priors)

    def candidates(self, lens: Lens) -> list[Candidate]:
        """Distinct cameras that picks agree with, best first; empty if there is none."""
        return self.worked_out(lens, self._finalists(lens, self._starts(lens)))

    def worked_out(self, lens: Lens, starts: list[Camera]) -> list[Candidate]:
        """The distinct cameras that `starts` lead to under `lens`, best first."""
        problem = self.problem(lens)
        estimates = [robust_estimate(problem, camera, self.noise) for camera in starts]
        sound = [e for e in estimates if e is not None and np.isfinite(e.length)]
        sound.sort(key=lambda e: e.length)
        kept = distinct([e.camera for e in sound], len(sound))
        return [Candidate(lens, e) for e in sound if any(e.camera is c for c in kept)]

    def _starts(self, lens: Lens) -> list[Camera]:
        lenses = lens.focal_candidates()
        options = MsacOptions(self.noise.gross_px, SAMPLES[len(lenses) > 1], seed=SEED)
        xy, xyz = self.picks.xy_px, self.picks.xyz_in_world
        found = []
        for k in lenses:
            ranked = [Camera(k, pose) for pose in sampled_poses(xy, xyz, k, options)[:60]]
            found += distinct(ranked, FINALISTS if len(lenses) == 1 else PER_LENS)
        return found + ([Camera(lens.intrinsics, self.start)] if self.start else [])

    def _finalists(self, lens: Lens, cameras: list[Camera]) -> list[Camera]:
        """The best distinct cameras after a coarse fit."""
        if len(cameras) <= FINALISTS:
            return cameras
        problem = self.problem(lens)
        scored: list[tuple[float, int, Camera]] = []
        for camera in cameras:
            fit = minimize(
                problem, camera, Loss("cauchy", self.noise.gross_px / 3), LmOptions(12, 1e-4)
            )
            scored.append((fit.cost, len(scored), fit.x))
        return distinct([camera for _, _, camera in sorted(scored)], FINALISTS)


def distinct(cameras: list[Camera], most: int) -> list[Camera]:
    """The first `most` cameras that are turned against all before them by `DISTINCT_RAD`."""
    kept: list[Camera] = []
    for camera in cameras:
        if len(kept) == most:
            break
        if all(turn_rad(camera.pose, other.pose) > DISTINCT_RAD for other in kept):
            kept.append(camera)
    return kept


def turn_rad(a: Pose, b: Pose) -> float:
    """Angle between the orientations of two poses."""
    cosine = (np.trace(a.R @ b.R.T) - 1) / 2
    return float(np.arccos(np.clip(cosine, -1, 1)))
