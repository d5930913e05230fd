"""Poses from pairs with gross outliers."""

from math import comb

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.solve.pnp import MsacOptions, msac_pose, needed_samples, triples

LENS = Intrinsics(3000, 2000, 2600, 2600, 1530, 980, (-0.1, 0.03, 0.001, -0.001, 0.0))


def scene(n, bad_share, sigma=1.0, seed=0):
    rng = np.random.default_rng(seed)
    camera = Camera(LENS, Pose.look_at([4.0, -5, 2.5], [0, 0, 0]))
    xyz = rng.uniform(-1, 1, (n, 3))
    xy = camera.project(xyz)[0] + rng.normal(0, sigma, (n, 2))
    bad = np.arange(n) < round(bad_share * n)
    xy[bad] = rng.uniform([0, 0], [3000, 2000], (bad.sum(), 2))
    return camera, xy, xyz, bad


@pytest.mark.parametrize(("n", "share"), [(4, 0), (6, 0), (15, 0.4), (40, 0.6), (2000, 0.6)])
def test_pose_and_inliers_are_found(n, share):
    """4 to 2000 pairs, up to 60 % wrong: the camera is within a few pixels, each outlier told."""
    for seed in range(5):
        camera, xy, xyz, bad = scene(n, share, seed=seed)
        fit = msac_pose(xy, xyz, LENS, MsacOptions(8))
        moved = Camera(LENS, fit.pose).project(xyz)[0] - camera.project(xyz)[0]
        assert np.abs(moved).max() < 10
        far = np.linalg.norm(xy - camera.project(xyz)[0], axis=1) > 16
        assert not fit.inliers[far].any()
        assert fit.inliers[~bad].mean() > 0.95


def test_same_seed_same_pose():
    """The search is random but repeatable."""
    _, xy, xyz, _ = scene(60, 0.5)
    a, b = (msac_pose(xy, xyz, LENS, MsacOptions(8, seed=3)) for _ in range(2))
    assert (a.pose.R == b.pose.R).all() and (a.pose.t == b.pose.t).all()


def test_map_coordinates_lose_nothing():
    """Points at 5,000,000 give the same picture as points at 0."""
    _, xy, xyz, _ = scene(20, 0)
    near = msac_pose(xy, xyz, LENS, MsacOptions(8))
    far = msac_pose(xy, xyz + 5e6, LENS, MsacOptions(8))
    assert np.allclose(near.residual_px, far.residual_px, atol=1e-3)


def test_triples_are_distinct_and_complete():
    """Few points: each triple once; many: as many as asked, none with a point twice."""
    rng = np.random.default_rng(0)
    indices = np.array([2, 3, 5, 7, 11, 13])
    every = triples(indices, 100, rng)
    assert len({tuple(sorted(t)) for t in every}) == comb(6, 3) == len(every)
    some = np.sort(triples(np.arange(50), 400, rng), axis=1)
    assert len(some) == 400 and (np.diff(some, axis=1) > 0).all()
    assert set(some.ravel()) == set(range(50))


def test_sample_count_follows_the_inlier_share():
    """Fischler and Bolles: 40 % inliers, 99.99 % sure: log 1e-4 / log(1 - .064) = 139 samples."""
    assert needed_samples(0.4, 0.9999) == pytest.approx(139.3, abs=0.1)


def test_nothing_to_find_is_none():
    """Pixels outside of what the lens can picture give no pose."""
    lens = Intrinsics(1000, 1000, 500, 500, 500, 500, (-0.8, 0, 0, 0, 0))
    corner = np.tile([[0.0, 0.0]], (5, 1))
    assert msac_pose(corner, np.eye(5, 3), lens, MsacOptions(5)) is None
