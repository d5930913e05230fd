"""Moves of a camera measured in pixels of image motion, and a search over them that needs no
derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import nlopt
import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera, Pose

PROBE_STEP = 1e-4
"""Step of the differences that measure image motion: radians, parts of the distance, log focal."""
WEAKEST = 0.05
"""Sensitivity, relative to the strongest move, below which a move is not stretched any further:
what hardly shows in the picture must not run away."""
PLACES_EACH = 3
"""Evaluations per unknown of a quadratic fit."""


@dataclass(frozen=True, eq=False)
class CameraSteps:
    """Cameras around `camera`, addressed by steps (p,) in pixels of image motion.

    A step of length 1 in any direction moves the image of the probes by 1 pixel (root mean
    square), less for moves that hardly show. p = 6 for the pose, 7 with the focal length, whose
    change is compensated by the distance, so that the size in the picture stays (dolly).
    basis: (7, p) natural parameters (rotation about `pivot_in_cam`, translation in parts of its
    distance, log focal) per step.
    """

    camera: Camera
    pivot_in_cam: Doubles
    basis: Doubles

    @property
    def count(self) -> int:
        return self.basis.shape[1]

    @classmethod
    def around(cls, camera: Camera, xyz_in_world: Doubles, focal: bool = False) -> CameraSteps:
        """Steps scaled by the motion of (n, 3) probe points that `camera` sees."""
        pivot = camera.pose.apply(xyz_in_world).mean(axis=0)
        natural = np.eye(7)[:, : 6 + focal]
        plain = cls(camera, pivot, natural)
        motion = np.stack([plain._motion(e, xyz_in_world) for e in np.eye(6 + focal)], axis=1)
        _, strength, directions = np.linalg.svd(motion, full_matrices=False)
        strength = np.maximum(strength, WEAKEST * strength[0])
        return cls(camera, pivot, natural @ directions.T / strength)

    def _motion(self, direction: Doubles, xyz_in_world: Doubles) -> Doubles:
        """(2 n,) image motion per unit of a natural parameter, over sqrt(n)."""
        ahead, behind = (self.at(s * PROBE_STEP * direction) for s in (1, -1))
        gap = ahead.project(xyz_in_world)[0] - behind.project(xyz_in_world)[0]
        return np.nan_to_num(gap).ravel() / (2 * PROBE_STEP * np.sqrt(len(xyz_in_world)))

    def pose_delta(self) -> Doubles:
        """(p, p) the `Pose.step` (and log focal) per step, for small steps."""
        p, distance = self.pivot_in_cam, float(np.linalg.norm(self.pivot_in_cam))
        turned = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])
        natural = np.zeros((7, 7))
        natural[:3, :3] = np.eye(3)
        natural[3:6, :3], natural[3:6, 3:6] = turned, distance * np.eye(3)
        natural[5, 6], natural[6, 6] = p[2], 1
        return (natural @ self.basis)[: self.count]

    def at(self, step_px: Doubles) -> Camera:
        """The camera `step_px` (p,) away."""
        natural = self.basis @ step_px
        R = cv2.Rodrigues(natural[:3].reshape(3, 1))[0]
        pivot, zoom = self.pivot_in_cam, float(np.exp(natural[6]))
        shift = natural[3:6] * np.linalg.norm(pivot)
        shift[2] += (zoom - 1) * pivot[2]
        pose = self.camera.pose
        t = R @ (pose.t - pivot) + pivot + shift
        k = self.camera.intrinsics
        k = replace(k, fx=k.fx * zoom, fy=k.fy * zoom) if zoom != 1 else k
        return Camera(k, Pose(R @ pose.R, t))


@dataclass(frozen=True, eq=False)
class Found:
    """The end of a search.

    x: where the search ended; value: there; initial: at the start; evaluations: how many.
    """

    x: Doubles
    value: float
    initial: float
    evaluations: int


def maximize(
    function: Callable[[Doubles], float],
    parameters: int,
    first_step: float,
    last_step: float,
    evaluations: int,
    reach: float,
) -> Found:
    """The local maximum of `function` uphill from 0, within +-`reach` along each parameter.

    BOBYQA (Powell, "The BOBYQA algorithm for bound constrained optimization without
    derivatives", 2009), steps from `first_step` down to `last_step`.
    """
    origin = np.zeros(parameters)
    initial = function(origin)
    best = Found(origin, initial, initial, 1)
    count = 1

    def observed(x: Doubles, _: Doubles) -> float:
        nonlocal best, count
        count += 1
        value = function(x.copy())
        if value > best.value:
            best = Found(x.copy(), value, initial, count)
        return value

    search = nlopt.opt(nlopt.LN_BOBYQA, parameters)
    search.set_max_objective(observed)
    search.set_lower_bounds(-reach * np.ones(parameters))
    search.set_upper_bounds(reach * np.ones(parameters))
    search.set_initial_step(first_step)
    search.set_xtol_abs(last_step)
    search.set_maxeval(evaluations)
    with suppress(nlopt.RoundoffLimited):  # as exact as it gets: the best so far stands
        search.optimize(origin)
    return replace(best, evaluations=count)


def curvature(function: Callable[[Doubles], float], parameters: int, radius: float) -> Doubles:
    """(p, p) second derivatives around 0: of the quadratic that fits the function best at random
    places `radius` away. A function that is rough on a smaller scale does no harm.
    """
    p = parameters
    rows, columns = np.triu_indices(p)
    rng = np.random.default_rng(0)
    places = rng.standard_normal((PLACES_EACH * (1 + p + len(rows)), p))
    places *= radius / np.linalg.norm(places, axis=1, keepdims=True)
    places *= rng.uniform(0.3, 1.3, (len(places), 1))
    values = np.array([function(place) for place in places])
    squares = places[:, rows] * places[:, columns]
    basis = np.concatenate([np.ones((len(places), 1)), places, squares], axis=1)
    fitted = np.linalg.lstsq(basis, values, rcond=None)[0][1 + p :]
    out = np.zeros((p, p))
    out[rows, columns] = fitted
    return out + out.T
