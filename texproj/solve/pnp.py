"""Poses from 3D-2D pairs with gross outliers: three-point samples, a truncated score, polishing.

Score: MSAC (Torr and Zisserman, MLESAC, CVIU 2000): squared errors capped at the threshold.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb, log

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from texproj.arrays import Doubles
from texproj.camera import Camera, Intrinsics, Pose
from texproj.solve.lm import LmOptions, Loss, minimize
from texproj.solve.reprojection import Reprojection

SCORED_POINTS = 300
"""Hypotheses are ranked on at most so many pairs; the survivors on all."""


@dataclass(frozen=True)
class MsacOptions:
    """How three-point samples are drawn and judged.

    threshold_px: distance beyond which a pair counts as wrong; samples: most three-point
    sets to try; confidence: wanted chance to have drawn one set without outliers; seed: of the
    drawing; polished: how many best hypotheses are refined.
    """

    threshold_px: float
    samples: int = 600
    confidence: float = 0.9999
    seed: int = 0
    polished: int = 5


@dataclass(frozen=True, eq=False)
class PnpFit:
    """The pose that most pairs agree on.

    pose; inliers: (n,) bool, closer than the threshold; score: mean capped squared error over
    the squared threshold (0 best, 1 nothing fits); residual_px: (n,) distances, inf behind.
    """

    pose: Pose
    inliers: NDArray[np.bool_]
    score: float
    residual_px: Doubles


def msac_pose(
    xy_px: Doubles, xyz_in_world: Doubles, intrinsics: Intrinsics, options: MsacOptions
) -> PnpFit | None:
    """The pose that most pairs agree on; None if no sample gives one.

    xy_px: (n, 2), xyz_in_world: (n, 3), n >= 4. Deterministic for a seed.
    """
    fits = msac_poses(xy_px, xyz_in_world, intrinsics, options)
    return fits[0] if fits else None


def msac_poses(
    xy_px: Doubles, xyz_in_world: Doubles, intrinsics: Intrinsics, options: MsacOptions
) -> list[PnpFit]:
    """The best poses after polishing, best first; several may be the same minimum."""
    poses = sampled_poses(xy_px, xyz_in_world, intrinsics, options)
    fits = [
        polish(xy_px, xyz_in_world, Camera(intrinsics, pose), options.threshold_px)
        for pose in poses[: options.polished]
    ]
    return sorted(fits, key=lambda fit: fit.score)


def sampled_poses(
    xy_px: Doubles, xyz_in_world: Doubles, intrinsics: Intrinsics, options: MsacOptions
) -> list[Pose]:
    """Poses from three-point samples, best score first."""
    k = intrinsics
    ideal = k.undistort((xy_px - (k.cx, k.cy)) / (k.fx, k.fy))
    usable = np.flatnonzero(np.isfinite(ideal).all(axis=1))
    if len(usable) < 4:
        return []
    rng = np.random.default_rng(options.seed)
    scored = usable
    if len(usable) > SCORED_POINTS:
        scored = rng.choice(usable, SCORED_POINTS, replace=False)
    center = xyz_in_world.mean(axis=0)
    xyz = xyz_in_world - center
    threshold = options.threshold_px / np.sqrt(k.fx * k.fy)
    R = np.zeros((0, 3, 3))
    t = np.zeros((0, 3))
    scores = np.zeros(0)
    drawn = 0
    for batch in _batches(triples(usable, options.samples, rng), 50):
        new_R, new_t = _solve_triples(xyz, ideal, batch)
        new = _scores(xyz[scored], ideal[scored], new_R, new_t, threshold)
        R, t = np.concatenate([R, new_R]), np.concatenate([t, new_t])
        scores = np.concatenate([scores, new])
        drawn += len(batch)
        if len(scores) and drawn >= needed_samples(1 - scores.min(), options.confidence):
            break
    order = np.argsort(scores, kind="stable")
    return [Pose(R[i], t[i] - R[i] @ center) for i in order]


def needed_samples(inlier_share: float, confidence: float) -> float:
    """How many triples to draw so that one is clean with `confidence` (Fischler, Bolles 1981)."""
    clean = np.clip(inlier_share, 1e-3, 0.999) ** 3
    return max(50.0, log(1 - confidence) / log(1 - clean))


def triples(indices: NDArray[np.int64], most: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """(m, 3) distinct triples of `indices` in random order: all of them if they are few."""
    n = len(indices)
    if comb(n, 3) <= most:
        every = np.array(list(combinations(range(n), 3)))
        return indices[rng.permutation(every)]
    drawn = rng.integers(0, [n, n - 1, n - 2], (most, 3))
    first, second, third = drawn.T
    second = second + (second >= first)
    low, high = np.minimum(first, second), np.maximum(first, second)
    third = third + (third >= low)
    third = third + (third >= high)
    return indices[np.stack([first, second, third], axis=1)]


def polish(xy_px: Doubles, xyz_in_world: Doubles, camera: Camera, threshold_px: float) -> PnpFit:
    """The pose of `camera` refined over all pairs with a Cauchy loss of a quarter threshold."""
    problem = Reprojection(xy_px, xyz_in_world, threshold_px / 4)
    residual = problem.residual(camera)
    near = np.isfinite(residual).all(axis=1) & ((residual**2).sum(axis=1) < 40**2)
    if near.sum() >= 4:
        local = Reprojection(xy_px[near], xyz_in_world[near], threshold_px / 4)
        camera = minimize(local, camera, Loss("cauchy"), LmOptions(30, 1e-6)).x
    return judged(xy_px, xyz_in_world, camera, threshold_px)


def judged(xy_px: Doubles, xyz_in_world: Doubles, camera: Camera, threshold_px: float) -> PnpFit:
    """How well a camera explains the pairs."""
    offset = camera.project(xyz_in_world)[0] - xy_px
    distance = np.nan_to_num(np.linalg.norm(offset, axis=1), nan=np.inf)
    score = float(np.minimum((distance / threshold_px) ** 2, 1).mean())
    return PnpFit(camera.pose, distance < threshold_px, score, distance)


def _batches(rows: NDArray[np.int64], size: int) -> list[NDArray[np.int64]]:
    return [rows[i : i + size] for i in range(0, len(rows), size)]


def _solve_triples(
    xyz: Doubles, ideal: Doubles, batch: NDArray[np.int64]
) -> tuple[Doubles, Doubles]:
    """((m, 3, 3), (m, 3)) of all poses that the triples allow (Ding et al., CVPR 2023)."""
    rotations: list[Doubles] = []
    translations: list[Doubles] = []
    for triple in batch:
        rvecs, tvecs = cv2.solveP3P(
            xyz[triple], ideal[triple].reshape(3, 1, 2), np.eye(3), None, cv2.SOLVEPNP_P3P
        )[1:]
        rotations += [r.ravel() for r in rvecs]
        translations += [t.ravel() for t in tvecs]
    r, t = np.array(rotations).reshape(-1, 3), np.array(translations).reshape(-1, 3)
    sound = np.isfinite(r).all(axis=1) & np.isfinite(t).all(axis=1)
    return Rotation.from_rotvec(r[sound]).as_matrix(), t[sound]


def _scores(xyz: Doubles, ideal: Doubles, R: Doubles, t: Doubles, threshold: float) -> Doubles:
    """(m,) mean capped squared error over the squared threshold, in normalized coordinates."""
    in_cam = np.einsum("mij,nj->mni", R, xyz) + t[:, None]
    depth = in_cam[..., 2]
    front = depth > 0
    offset = in_cam[..., :2] / np.where(front, depth, 1)[..., None] - ideal
    s = np.where(front, (offset**2).sum(axis=2) / threshold**2, 1)
    return np.minimum(s, 1).mean(axis=1)
