"""Where all photos lie together on the mesh: how it is told, how picks hold it; photos apart."""

from dataclasses import dataclass

import numpy as np
import pytest
from test_solve_joint import ALL, surface, three_cameras

from texproj.camera import Camera
from texproj.register.joint.frame import Similarity, certainty, common_similarity, frame_px
from texproj.register.joint.holding import Picks, held_by_picks
from texproj.register.joint.lone import contradicted, far_apart
from texproj.solve.joint import Ties

CENTER = np.array([0.1, -0.2, 0.0])
MOTION = np.array([0.004, 0.003, -0.002, 0.004, 0.01, 0.004, -0.02])
LOOSE = np.diag(np.full(7, 0.01) ** 2)


def moved(cameras, seven):
    similarity = Similarity.of(np.asarray(seven), CENTER)
    return [Camera(c.intrinsics, similarity.moved(c.pose)) for c in cameras]


def seen(count=3, n=30):
    rng = np.random.default_rng(1)
    return [surface(rng, n)[0] for _ in range(count)]


def apart_px(found, truth):
    xyz = surface(np.random.default_rng(2), 100)[0]
    pairs = zip(found, truth, strict=True)
    return [np.linalg.norm(a.project(xyz)[0] - b.project(xyz)[0], axis=1).mean() for a, b in pairs]


def test_a_similarity_moves_cameras_and_leaves_what_they_see():
    """A moved camera sees x where the other sees the moved x."""
    camera = three_cameras()[0]
    xyz = surface(np.random.default_rng(3), 50)[0]
    turn = moved([camera], MOTION)[0]
    scale, shift = np.exp(MOTION[0]), MOTION[4:]
    R = camera.pose.R.T @ turn.pose.R
    there = scale * (xyz - CENTER) @ R.T + CENTER + shift

    assert np.abs(turn.project(xyz)[0] - camera.project(there)[0]).max() < 1e-6


def test_the_common_motion_is_found_among_others():
    """The seven numbers, though each camera also moves by itself."""
    truth = three_cameras()
    after = moved(truth, MOTION)
    found = common_similarity(truth, after, seen(), CENTER)

    assert [found.log_scale, *found.rotation, *found.shift] == pytest.approx(MOTION, abs=2e-5)


@dataclass
class Whole:
    """A covariance with all its numbers."""

    matrix: np.ndarray

    def times(self, columns):
        return self.matrix @ columns

    def of_camera(self, k, lens):
        own = np.concatenate([6 * k + np.arange(6), 18 + lens])
        return self.matrix[np.ix_(own, own)]


def test_what_all_share_is_frame_and_the_rest_agreement():
    """Only a common motion is unsure: no disagreement; each camera by itself: both."""
    cameras, points = three_cameras(), seen()
    free = np.ones(3, bool)
    alone = certainty(cameras, points, ALL, free, Whole(np.eye(18 + ALL.count) * 1e-8))
    change = np.zeros((18 + ALL.count, 7))
    for column, h in enumerate(np.eye(7) * 1e-5):
        for k, camera in enumerate(moved(cameras, h)):
            turn = camera.pose.R @ cameras[k].pose.R.T
            change[6 * k : 6 * k + 3, column] = turn[2, 1], turn[0, 2], turn[1, 0]
            change[6 * k + 3 : 6 * k + 6, column] = camera.pose.t - turn @ cameras[k].pose.t
    common = certainty(cameras, points, ALL, free, Whole(change @ change.T))

    assert min(alone.agreement_px) > 0.02
    assert max(common.agreement_px) < 1e-2 * min(
        frame_px(cameras, points, common.center, common.frame)
    )


def test_picks_bring_all_photos_to_their_place():
    """Picks in two photos, one of them grossly wrong: the third follows; the deviations that are
    told are those of the picks.
    """
    truth = three_cameras()
    start = moved(truth, 3 * MOTION)
    rng = np.random.default_rng(4)
    picks = {}
    for k in (0, 1):
        xyz = surface(rng, 40)[0]
        xy = truth[k].project(xyz)[0] + rng.normal(0, 1.0, (40, 2))
        picks[k] = Picks(xy, xyz, 1.0)
    picks[0].xy_px[3] += 60
    motion, frame = held_by_picks(dict(enumerate(start)), picks, CENTER, LOOSE)
    found = [Camera(c.intrinsics, motion.moved(c.pose)) for c in start]
    told = frame_px(found, seen(), CENTER, frame)

    assert min(apart_px(start, truth)) > 2
    assert max(apart_px(found, truth)) < 1.0
    assert 0.1 < max(apart_px(found, truth)) / max(told) < 3


def test_a_photo_whose_partners_contradict_each_other_is_named_and_a_noisy_one_is_not():
    """Half a pixel of bias against two pixels of noise."""
    rng = np.random.default_rng(5)
    number = np.array([(i, j) for i in range(5) for j in range(5) if i != j])
    to, source = np.repeat(number, 60, axis=0).T
    n = len(to)
    ties = Ties(to, source, *(np.zeros((n, 2)),) * 3, *(np.zeros((n, 3)),) * 2)
    apart = rng.normal(0, 0.2, (n, 2))
    apart[(to == 1) | (source == 1)] *= 5
    fixed = np.zeros(5, bool)

    assert contradicted(ties, apart, fixed) == []
    for j in (0, 1, 2, 4):
        direction = rng.normal(0, 1, 2)
        apart[((to == 3) & (source == j)) | ((to == j) & (source == 3))] += (
            0.6 * direction / np.linalg.norm(direction)
        )
    number, reason = contradicted(ties, apart, fixed)[0]
    assert number == 3 and "contradicts" in reason
    assert contradicted(ties, apart, np.arange(5) == 3) == []


def test_contradictions_far_apart_are_looked_at_together():
    """On a line of photos, each compared with the next: 5 and 9 have no partner in common with 1
    or each other, 3 has one with 1. Where all are compared with all, one at a time.
    """
    lone = [(1, "a"), (3, "b"), (5, "c"), (9, "d")]
    line = [(k, k + 1) for k in range(11)]
    everybody = [(i, j) for i in range(11) for j in range(i)]

    assert [k for k, _ in far_apart(lone, line)] == [1, 5, 9]
    assert [k for k, _ in far_apart(lone, everybody)] == [1]
