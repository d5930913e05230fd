"""The joint solve of many cameras, its covariance included: processor time and memory of a round.

    python tests/bench_joint.py [--cameras 1000] [--ties 100]

Cameras in rows above a wavy ground, each tied to the eight nearest by so many points of the ground
with .5 px of noise, in two groups that share a lens; they start some pixels off. Floor: 1000
cameras within 60 s of processor time.
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np
from scipy.spatial import cKDTree

from texproj.camera import Camera, Intrinsics, Pose
from texproj.solve.joint import Anchors, JointPoses, Ties
from texproj.solve.joint_covariance import JointCovariance
from texproj.solve.lm import LmOptions, Loss, minimize
from texproj.solve.shared_lens import LensParameters, SharedIntrinsics

LENS = Intrinsics(1600, 1200, 1500, 1500, 800, 600, (-0.05, 0.01, 0, 0, 0))
HEIGHT, APART, SPREAD = 4.0, 0.6, 1.2
POINTS, OFF_RAD = 24, 0.002


def ground(xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) points and unit normals, up, of a wavy ground at (n, 2)."""
    x, y = xy.T
    z = 0.3 * np.sin(2 * x) * np.cos(2 * y)
    normal = np.stack([-0.6 * np.cos(2 * x) * np.cos(2 * y),
                       0.6 * np.sin(2 * x) * np.sin(2 * y), np.ones(len(x))], axis=1)  # fmt: skip
    return np.column_stack([xy, z]), normal / np.linalg.norm(normal, axis=1, keepdims=True)


def scene(count: int, ties: int, rng: np.random.Generator):
    """True cameras, all ties, and what the cameras' own registrations say."""
    side = int(np.ceil(np.sqrt(count)))
    where = APART * np.stack(np.divmod(np.arange(count), side), axis=1) + rng.normal(
        0, 0.05, (count, 2)
    )
    cameras = tuple(
        Camera(LENS, Pose.look_at((x, y, HEIGHT), (x, y, 0), (0, 1, 0))) for x, y in where
    )
    parts = []
    for i, near in enumerate(cKDTree(where).query(where, 9)[1][:, 1:]):
        for j in near:
            middle = (where[i] + where[j]) / 2
            xyz, normal = ground(middle + rng.uniform(-SPREAD / 2, SPREAD / 2, (ties, 2)))
            ray = cameras[j].pose.apply(xyz)
            px = cameras[i].project(xyz)[0] + rng.normal(0, 0.5, (ties, 2))
            numbers = np.full(ties, i), np.full(ties, j)
            source, ideal = cameras[j].project(xyz)[0], ray[:, :2] / ray[:, 2:]
            parts.append(Ties(*numbers, px, source, ideal, xyz, normal))
    points = np.concatenate([ground(at + rng.uniform(-1, 1, (POINTS, 2)))[0] for at in where])
    number = np.repeat(np.arange(count), POINTS)
    px = np.concatenate(
        [c.project(points[number == k])[0] for k, c in enumerate(cameras)]
    ) + rng.normal(0, 3, (len(points), 2))
    return cameras, Ties.joined(parts), Anchors(number, points, px, np.full(len(px), 10.0))


def lenses(count: int) -> LensParameters:
    """Two groups, focal length and two numbers of distortion solved."""
    names, group = ("focal", "k1", "k2"), np.arange(count) % 2
    value = np.tile([np.log(LENS.fx), -0.05, 0.01], (2, 1))
    sigma, free = np.full((2, 3), 0.01), np.ones((2, 3), bool)
    return LensParameters((SharedIntrinsics(names, group, value, sigma, free),))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cameras", type=int, default=1000)
    parser.add_argument("--ties", type=int, default=100)
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    truth, ties, anchors = scene(options.cameras, options.ties, rng)
    start = tuple(
        Camera(c.intrinsics, c.pose.step(rng.normal(0, OFF_RAD, 6) * [1, 1, 1, 4, 4, 4]))
        for c in truth
    )
    fixed, sigma = np.zeros(len(truth), bool), np.full(len(truth), 0.5)
    joint = JointPoses(ties, anchors, lenses(len(truth)), sigma, fixed)
    begun = time.process_time()
    fit = minimize(joint, start, Loss("cauchy", 1.5), LmOptions(15, 1e-5))
    solved = time.process_time()
    covariance = JointCovariance.of(fit, 20.0, len(truth))
    assert covariance is not None
    columns = joint.lenses.columns
    wide = [np.trace(covariance.of_camera(k, columns[k])) for k in range(len(truth))]
    told = time.process_time()
    shown = anchors.point.reshape(len(truth), POINTS, 3)
    off = [np.linalg.norm(a.project(xyz)[0] - b.project(xyz)[0], axis=1).mean()
           for a, b, xyz in zip(fit.x, truth, shown, strict=True)]  # fmt: skip
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{len(truth)} cameras, {len(ties)} ties, {fit.iterations} steps: solve"
          f" {solved - begun:.1f} s, covariance {told - solved:.1f} s of processor time, peak"
          f" {peak:.0f} MB; off by {np.median(off):.2f} px; widest {max(wide):.2g}")  # fmt: skip


if __name__ == "__main__":
    main()
