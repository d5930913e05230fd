"""Damped least squares on problems whose answers are known on paper."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from texproj.solve.lm import FAR, JacobianPart, LmOptions, Loss, minimize
from texproj.solve.reprojection import displacement_variance


@dataclass(frozen=True, eq=False)
class Line:
    """y = a + b x; residuals of one column over sigma."""

    x: np.ndarray
    y: np.ndarray
    sigma: float = 1.0
    known_slope: float | None = None
    in_parts: bool = False

    def residual(self, p):
        return ((p[0] + p[1] * self.x - self.y) / self.sigma)[:, None]

    def jacobian(self, p):
        rows = np.stack([np.ones_like(self.x), self.x], axis=1) / self.sigma
        return self._parts(rows) if self.in_parts else rows[:, None, :]

    def _parts(self, rows):
        for first in (1, 0, 2):
            chosen = np.arange(first, len(rows), 3)
            half = 0.5 * rows[chosen, 1]  # the slope in two columns of one number
            block = np.stack([half, rows[chosen, 0], half], axis=1)[:, None]
            yield JacobianPart(chosen, np.array([1, 0, 1]), block)

    def step(self, p, delta):
        return p + delta

    def prior(self, p):
        if self.known_slope is None:
            return np.zeros(0), np.zeros((0, 2))
        return np.array([(p[1] - self.known_slope) / 1e-6]), np.array([[0, 1e6]])


@dataclass(frozen=True, eq=False)
class Valley:
    """Rosenbrock's valley as least squares: minimum 0 at (1, 1)."""

    def residual(self, p):
        return np.array([[10 * (p[1] - p[0] ** 2), 1 - p[0]]])

    def jacobian(self, p):
        return np.array([[[-20 * p[0], 10], [-1, 0]]])

    def step(self, p, delta):
        return p + delta

    def prior(self, p):
        return np.zeros(0), np.zeros((0, 2))


START = np.zeros(2)


def noisy_line(seed, n=200, sigma=0.3):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 3, n)
    return x, 2 - 0.5 * x + rng.normal(0, sigma, n)


def test_linear_problem_equals_the_normal_equations():
    """A linear problem ends at the closed form, and says why it stopped."""
    x, y = noisy_line(1)
    fit = minimize(Line(x, y), START)
    slope, offset = np.polyfit(x, y, 1)
    assert np.allclose(fit.x, [offset, slope], atol=1e-9)
    assert fit.stop in ("gradient", "cost") and fit.iterations < 30
    assert fit.cost < fit.initial_cost == pytest.approx((y**2).sum())


def test_covariance_estimates_the_scatter():
    """Without knowing the noise the covariance is that of ordinary least squares."""
    x, y = noisy_line(2, sigma=0.3)
    fit = minimize(Line(x, y), START)
    _, truth = np.polyfit(x, y, 1, cov="unscaled")
    rest = (fit.residual**2).sum() / (len(x) - 2)
    assert np.allclose(fit.covariance()[::-1, ::-1], truth * rest, rtol=1e-6)


@pytest.mark.parametrize("loss", [Loss("l2"), Loss("cauchy", 2.0), Loss("geman-mcclure", 4.0)])
def test_covariance_predicts_the_spread_over_repetitions(loss):
    """The predicted standard deviations match those of 300 repeated measurements within 15 %."""
    fits = [minimize(Line(*noisy_line(seed, 60), 0.3), START, loss) for seed in range(300)]
    seen = np.std([fit.x for fit in fits], axis=0)
    told = np.sqrt(np.mean([np.diag(fit.covariance()) for fit in fits], axis=0))
    assert np.all(np.abs(told / seen - 1) < 0.15)


def test_a_robust_loss_resists_what_moves_least_squares():
    """A fifth of the values being off by 4 moves the mean line by 0.8, the robust one little."""
    x, y = noisy_line(3, sigma=0.1)
    y[::5] += 4
    truth = np.array([2, -0.5])
    start = np.array([2.5, -0.4])
    plain = minimize(Line(x, y, 0.1), start).x
    robust = minimize(Line(x, y, 0.1), start, Loss("cauchy", 2)).x
    assert abs(plain - truth).max() > 0.5
    assert abs(robust - truth).max() < 0.2


@pytest.mark.parametrize("kind", ["l2", "cauchy", "geman-mcclure"])
def test_weight_and_curvature_are_derivatives_of_the_cost(kind):
    """rho' and s rho'' agree with central differences of rho."""
    loss, h = Loss(kind, 1.5), 1e-5
    s = np.array([0.01, 0.5, 1.9, 3.0, 40.0])
    slope = (loss.cost(s + h) - loss.cost(s - h)) / (2 * h)
    bend = (loss.weight(s + h) - loss.weight(s - h)) / (2 * h)
    assert np.allclose(loss.weight(s), slope, atol=1e-8)
    assert np.allclose(loss.curvature(s), s * bend, atol=1e-8)


def test_curved_valley_is_followed_to_its_end():
    """Rosenbrock's valley from the usual far start ends at (1, 1) to 1e-6."""
    fit = minimize(Valley(), np.array([-1.2, 1.0]))
    assert np.allclose(fit.x, 1, atol=1e-6)
    assert fit.iterations < 60


def test_iterations_are_limited():
    """A fit cut short says so and is no worse than its start."""
    fit = minimize(Valley(), np.array([-1.2, 1.0]), options=LmOptions(max_iterations=3))
    assert fit.stop == "iterations" and fit.iterations == 3
    assert fit.cost < fit.initial_cost


def test_priors_hold_a_parameter():
    """A tight prior on the slope keeps it, and the covariance knows."""
    x, y = noisy_line(4)
    fit = minimize(Line(x, y, 0.3, known_slope=0.0), START)
    assert abs(fit.x[1]) < 1e-8
    assert fit.x[0] == pytest.approx(y.mean(), abs=1e-6)
    assert np.sqrt(fit.covariance()[1, 1]) == pytest.approx(1e-6, rel=0.01)


def test_a_covariance_that_cannot_be_computed_is_infinite(monkeypatch):
    """No traceback out of the eigenvalues: nothing is known is a value, and no camera is sure."""
    x = np.arange(5.0)
    fit = minimize(Line(x, 1 + 2 * x), np.zeros(2))
    broken = replace(fit, data_hessian=np.full((2, 2), np.nan))

    assert np.isinf(broken.covariance()).all()
    jacobian = np.ones((4, 2, 2))
    assert np.isinf(displacement_variance(jacobian, broken.covariance())).all()
    assert np.isfinite(displacement_variance(jacobian, np.eye(2))).all()

    def fails(_):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr(np.linalg, "eigh", fails)
    assert np.isinf(fit.covariance()).all()


def test_undetermined_parameters_have_infinite_covariance():
    """Values at a single x leave the line's slope open."""
    fit = minimize(Line(np.ones(5), np.arange(5.0)), START)
    assert np.isinf(fit.covariance()).all()


def test_rows_that_cannot_be_computed_count_as_far_off():
    """NaN rows carry no weight and a large, finite cost."""
    x, y = noisy_line(5)
    y[:3] = np.nan
    fit = minimize(Line(x, y, 0.3), START, Loss("cauchy", 2))
    assert (fit.weights[:3] == 0).all() and np.isfinite(fit.x).all()
    assert fit.cost > 3 * Loss("cauchy", 2).cost(np.array([FAR**2]))[0]


def test_a_jacobian_in_parts_agrees_with_the_whole_one():
    """The same problem in parts in any order gives the same answer and covariance."""
    x, y = noisy_line(6)
    dense = minimize(Line(x, y, 0.3), START, Loss("cauchy", 1.3))
    thin = minimize(Line(x, y, 0.3, in_parts=True), START, Loss("cauchy", 1.3))
    assert np.allclose(dense.x, thin.x, atol=1e-9)
    assert np.allclose(dense.covariance(), thin.covariance(), rtol=1e-6)
