"""Nearly symmetric scans: the surface tells which way round they are."""

from types import SimpleNamespace

import numpy as np
import pytest

from texproj.mesh import Mesh
from texproj.register.block.cloud import Cloud
from texproj.register.block.mirror_surface import surface_t
from texproj.register.block.mirror_test import MirrorTest, mirrored_cloud
from texproj.register.block.placed_block import PlacedBlock
from texproj.register.block.scan_samples import ScanSamples
from texproj.register.block.similarity import Similarity

STILL = Similarity(1.0, np.eye(3), np.zeros(3))


def height(x, y, uneven):
    """A symmetric relief with something uneven about it."""
    even = 0.05 * np.cos(9 * x) + 0.05 * np.cos(7 * y) + 0.03 * np.cos(15 * x * y)
    return even + uneven * np.sin(8 * x) * np.cos(5 * y)


def scan(uneven, noise, rng):
    """A coarse, noisy scan of it, seen from -z."""
    side = np.linspace(-0.5, 0.5, 60)
    x, y = (v.ravel() for v in np.meshgrid(side, side))
    z = height(x, y, uneven) + rng.normal(0, noise, len(x))
    k = np.arange(60 * 59).reshape(59, 60)[:, :-1].ravel()
    faces = np.concatenate([np.stack([k, k + 60, k + 1]), np.stack([k + 1, k + 60, k + 61])], 1).T
    return Mesh(np.stack([x, y, z], axis=1), faces)


def cloud(uneven, rng):
    """What photos from -z measured of the same."""
    x, y = rng.uniform(-0.45, 0.45, (2, 4000))
    xyz = np.stack([x, y, height(x, y, uneven) + rng.normal(0, 1e-3, 4000)], axis=1)
    eye = np.tile(np.float32([0, 0, -3]), (4000, 1))
    toward = eye - xyz
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    return Cloud(STILL, xyz.astype(np.float32), eye, toward.astype(np.float32))


def told(uneven, noise=4e-3, seed=0):
    """t of the cloud on the scan against its mirror image there."""
    rng = np.random.default_rng(seed)
    samples = ScanSamples.of(scan(uneven, noise, rng))
    proposer = SimpleNamespace(scan=SimpleNamespace(samples=samples))
    place = SimpleNamespace(pivot=np.zeros(3), unit=1.0, proposer=proposer)
    here = SimpleNamespace(placed=PlacedBlock(STILL), place=place)
    points = cloud(uneven, rng)
    other = mirrored_cloud(points)
    return surface_t(points, here, other, here), surface_t(other, here, points, here)


def test_the_right_way_round_lies_nearer_to_the_surface():
    """By a hundredth of the size, under noise of half of that, on a scan of 60 x 60 points."""
    right, wrong = told(0.01)

    assert right > 3
    assert wrong < -3


@pytest.mark.parametrize("seed", range(3))
def test_what_is_symmetric_tells_nothing(seed):
    right, wrong = told(0.0, seed=seed)

    assert abs(right) < 2.5 and abs(wrong) < 2.5


def test_details_that_are_sure_need_no_surface():
    assert MirrorTest(-3.1).refused and not MirrorTest(3.1).undecided
    assert MirrorTest(1.0).undecided and not MirrorTest(1.0).refused


@pytest.mark.parametrize(
    ("details", "surface", "refused", "undecided"),
    [(0.9, 3.0, False, True), (2.9, 2.0, False, False), (1.7, -1.9, True, False),
     (-2.9, 0.2, True, False), (0.1, -0.2, False, True)],
)  # fmt: skip
def test_both_together_decide(details, surface, refused, undecided):
    told = MirrorTest(details, by_surface=surface)

    assert told.refused == refused and told.undecided == undecided
