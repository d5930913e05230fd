"""Bundle adjustment: cameras, lens and points at once, and what their covariance says."""

from dataclasses import replace

import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.solve.bundle import Adjusted, Bundle, KnownPoints, Planes, Tracks, adjust
from texproj.solve.shared_lens import LensParameters, SharedIntrinsics

LENS = Intrinsics(1000, 800, 900.0, 900.0, 495.0, 410.0, (-0.05, 0.0, 0.0, 0.0, 0.0))
PLACES = ((-1.5, -3.2, 0.4), (-0.4, -3.6, -0.3), (0.7, -3.3, 0.5), (1.8, -2.9, 0.0))
NOISE_PX, NOISE_PLANE = 0.5, 0.004
NOTHING = KnownPoints(
    np.zeros(0, np.intp), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0), np.zeros(0)
)


def cameras():
    return tuple(Camera(LENS, Pose.look_at(place, (0.1 * place[0], 0, 0))) for place in PLACES)


def lenses(count):
    group = np.zeros(count, np.intp)
    one = SharedIntrinsics(
        ("focal", "k1"), group, np.array([[np.log(900.0), -0.05]]), np.array([[0.02, 0.05]]),
        np.array([[True, True]]),
    )  # fmt: skip
    return LensParameters((one,))


def surface(rng, count=80):
    """Points of a waved sheet, and its planes there."""
    x, z = rng.uniform(-1, 1, (2, count))
    xyz = np.stack([x, 0.3 * np.sin(3 * x) * np.cos(2 * z), z], axis=1)
    slope = [
        -0.9 * np.cos(3 * x) * np.cos(2 * z),
        np.ones(count),
        0.6 * np.sin(3 * x) * np.sin(2 * z),
    ]
    normal = -np.stack(slope, axis=1)
    return xyz, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def measured(rng, xyz, normal):
    """The problem of noisy sightings by all cameras and a noisy surface, and points that start
    somewhere near.
    """
    views = cameras()
    camera, point = (k.ravel() for k in np.mgrid[: len(views), : len(xyz)])
    px = np.concatenate([view.project(xyz)[0] for view in views])
    tracks = Tracks(camera, point, px + rng.normal(0, NOISE_PX, px.shape),
                    np.full(len(px), NOISE_PX))  # fmt: skip
    off = rng.normal(0, NOISE_PLANE, (len(xyz), 1))
    planes = Planes(np.arange(len(xyz)), xyz + off * normal, normal,
                    np.full(len(xyz), NOISE_PLANE))  # fmt: skip
    return Bundle(tracks, planes, NOTHING, lenses(len(views)))


def away(found: Adjusted):
    """(p,) the step from the truth to what was found."""
    steps = []
    for mine, true in zip(found.cameras, cameras(), strict=True):
        turn = mine.pose.R @ true.pose.R.T
        w = (
            np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
            / 2
        )
        steps.append(np.concatenate([w, mine.pose.t - turn @ true.pose.t]))
    lens = found.cameras[0].intrinsics
    return np.concatenate([*steps, [np.log(lens.fx / 900), lens.dist[0] + 0.05]])


def disturbed(views, rng, size=0.01):
    return tuple(Camera(v.intrinsics, v.pose.step(rng.normal(0, size, 6))) for v in views)


def test_the_covariance_is_true():
    """Squared errors in units of what is expected are as many as unknowns, on average over noise:
    poses, lens and points were solved from what nobody told but tracks and a surface.
    """
    squares = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        xyz, normal = surface(rng)
        problem = measured(rng, xyz, normal)
        start = xyz + rng.normal(0, 0.02, xyz.shape)
        found = adjust(problem, disturbed(cameras(), rng), start, 30)
        squares.append(away(found) @ found.information @ away(found))

    assert 0.7 < np.mean(squares) / 26 < 1.4


def test_what_the_surface_lacks_does_not_pull():
    """A third of the points lie far in front of it: cameras end as without them."""
    rng = np.random.default_rng(3)
    xyz, normal = surface(rng, 120)
    problem = measured(rng, xyz, normal)
    wrong = problem.planes.on_plane.copy()
    wrong[::3] += 0.15 * normal[::3]
    bush = replace(problem, planes=replace(problem.planes, on_plane=wrong))
    right = replace(problem, planes=Planes(*(
        getattr(problem.planes, name)[np.arange(120) % 3 > 0]
        for name in ("point", "on_plane", "normal", "sigma")
    )))  # fmt: skip
    ends = [adjust(one, disturbed(cameras(), rng, 0.002), xyz, 30).cameras for one in (bush, right)]
    apart = [a.project(xyz)[0] - b.project(xyz)[0] for a, b in zip(*ends, strict=True)]

    assert np.abs(apart).max() < 0.1


def test_known_points_hold_what_nothing_else_does():
    """On a plane the cameras slide: picks in one of them hold all, and the covariance knows."""
    rng = np.random.default_rng(5)
    xyz = np.stack([*rng.uniform(-1, 1, (1, 80)), np.zeros(80), *rng.uniform(-1, 1, (1, 80))], 1)
    normal = np.tile([0.0, -1.0, 0.0], (80, 1))
    problem = measured(rng, xyz, normal)
    views = cameras()
    shown = xyz[:12]
    px = views[1].project(shown)[0] + rng.normal(0, 1.0, (12, 2))
    picks = KnownPoints(np.ones(12, np.intp), shown, px, np.full(12, 1.0), np.ones(12))
    start = disturbed(views, rng)
    held = adjust(replace(problem, known=picks), start, xyz, 40)
    loose = adjust(problem, start, xyz, 40)
    off = [np.linalg.norm(a.project(xyz)[0] - b.project(xyz)[0], axis=1).mean()
           for a, b in zip(held.cameras, views, strict=True)]  # fmt: skip

    assert max(off) < 2.0
    assert np.sqrt(np.diag(held.covariance())).max() < 0.1
    assert not np.diag(loose.covariance()).max() < 100


@pytest.mark.parametrize("steps", [0, 5])
def test_a_step_never_makes_it_worse(steps):
    rng = np.random.default_rng(7)
    xyz, normal = surface(rng)
    problem = measured(rng, xyz, normal)
    start = disturbed(cameras(), rng, 0.05)
    assert adjust(problem, start, xyz, steps).cost <= adjust(problem, start, xyz, 0).cost
