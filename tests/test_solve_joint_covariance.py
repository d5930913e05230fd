"""The covariance of many cameras against the inverse of the whole matrix."""

import numpy as np
import pytest
from scipy import sparse

from texproj.solve.joint_covariance import JointCovariance
from texproj.solve.lm import LmFit

LENSES = 3


def fitted(cameras, tied, rows=20, weak=1e-3):
    """A fit whose Hessian ties the pairs of cameras and, each camera, one number of a lens."""
    rng = np.random.default_rng(cameras)
    blocks = []
    for i, j in tied:
        row = np.zeros((rows, 6 * cameras + LENSES))
        for k in (i, j):
            row[:, 6 * k : 6 * k + 6] = rng.normal(size=(rows, 6)) * 10 ** rng.uniform(-2, 2, 6)
        row[:, 6 * cameras + i % LENSES] = rng.normal(size=rows)
        blocks.append(sparse.csr_array(row))
    jacobian = sparse.vstack(blocks)
    data = sparse.csc_array(jacobian.T @ jacobian)
    prior = sparse.csc_array(sparse.eye_array(data.shape[0]) * weak)
    nothing = np.zeros((1, 2))
    return LmFit(None, 0.0, 0.0, 1, "cost", nothing, np.ones(1), data, prior, 1.0)


def ties(cameras, seed=1):
    """A ring, some chords, and one camera that is tied to nobody."""
    rng = np.random.default_rng(seed)
    ring = [(k, (k + 1) % (cameras - 1)) for k in range(cameras - 1)]
    return ring + [tuple(rng.choice(cameras - 1, 2, replace=False)) for _ in range(cameras // 2)]


@pytest.mark.parametrize("cameras", [2, 30])
def test_it_is_the_inverse_where_it_is_asked_for(cameras):
    fit = fitted(cameras, ties(cameras) if cameras > 2 else [(0, 1)])
    whole = np.linalg.inv((fit.data_hessian / 3.0 + fit.prior_hessian).toarray())
    found = JointCovariance.of(fit, 3.0, cameras)
    for k in range(cameras):
        lens = np.array([k % LENSES])
        own = [*range(6 * k, 6 * k + 6), 6 * cameras + k % LENSES]
        expected = whole[np.ix_(own, own)]
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert (np.abs(found.of_camera(k, lens) - expected) / scale).max() < 1e-8
    columns = np.random.default_rng(0).normal(size=(len(whole), 7))
    assert np.allclose(found.times(columns), whole @ columns, rtol=1e-6, atol=1e-9)


def test_nothing_is_told_of_what_no_tie_holds():
    """A camera without ties, and all together where nothing holds them."""
    assert JointCovariance.of(fitted(5, ties(5), weak=0.0), 1.0, 5) is None
