"""Damped least squares (Levenberg-Marquardt) that knows nothing of cameras.

A problem gives residual, jacobian, step and prior; robust losses act on the length of each
residual row by iterative reweighting. The variable is any value that `step` can move.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, TypeVar

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from texproj.arrays import Doubles, Index

X = TypeVar("X")
FAR = 1e6
"""Length, in standard deviations, of a residual row that cannot be computed."""

LEAST_DAMPING, MOST_DAMPING = 1e-12, 1e16
"""Below the first the Hessian may be singular; above the second a step is below rounding."""

Stop = Literal["gradient", "cost", "stuck", "iterations"]


class Problem(Protocol[X]):
    """What the solver asks of a problem; residuals are divided by their standard deviation."""

    def residual(self, x: X) -> Doubles:
        """(n, d) residual rows; NaN where it cannot be computed, which counts as `FAR` off."""

    def jacobian(self, x: X) -> Any:
        """(n, d, p) float64 derivative of the residual by `step`'s delta, or an iterator over parts
        of it, which are never there together."""

    def step(self, x: X, delta: Doubles) -> X:
        """A new x, moved by `delta` (p,)."""

    def prior(self, x: X) -> tuple[Doubles, Any]:
        """((q,) residuals, (q, p) jacobian) of what is known beforehand; never reweighted. The
        jacobian may be sparse where that of the residuals is."""


@dataclass(frozen=True, eq=False)
class JacobianPart:
    """Rows of a jacobian that few parameters move. rows: (k,) their numbers, each in one part;
    columns: (c,) numbers of the parameters; block: (k, d, c), of which columns of the same number
    add up.
    """

    rows: Index
    columns: Index
    block: Doubles


@dataclass(frozen=True)
class Loss:
    """A robust loss rho of the squared length s of a whitened residual row, rho'(0) = 1.

    l2: s itself; cauchy: scale^2 log(1 + s/scale^2); geman-mcclure: s / (1 + s/scale^2), smooth,
    and constant in the end (Geman and McClure 1987).
    """

    kind: Literal["l2", "cauchy", "geman-mcclure"] = "l2"
    scale: float = 1.0

    def cost(self, s: Doubles) -> Doubles:
        """(n,) rho(s)."""
        c2 = self.scale**2
        if self.kind == "cauchy":
            return c2 * np.log1p(s / c2)
        return s / (1 + s / c2) if self.kind == "geman-mcclure" else s

    def weight(self, s: Doubles) -> Doubles:
        """(n,) rho'(s): the weight of the squared residual."""
        c2 = self.scale**2
        if self.kind == "cauchy":
            return 1 / (1 + s / c2)
        return 1 / (1 + s / c2) ** 2 if self.kind == "geman-mcclure" else np.ones_like(s)

    def curvature(self, s: Doubles) -> Doubles:
        """(n,) s rho''(s): how the weight falls as the residual grows."""
        c2 = self.scale**2
        if self.kind == "geman-mcclure":
            return -2 * s / c2 / (1 + s / c2) ** 3
        weight = self.weight(s)
        return -weight * (1 - weight)


@dataclass(frozen=True)
class LmOptions:
    """When to stop: after so many steps, or when a step would gain or gained less than
    `cost_tolerance`, as a part of the cost. damping: the first, relative to the Hessian's diagonal.
    """

    max_iterations: int = 100
    cost_tolerance: float = 1e-12
    damping: float = 1e-3


@dataclass(frozen=True, eq=False)
class LmFit(Generic[X]):
    """The end of a minimization.

    x: the minimum; cost: sum of robust costs and squared priors; weights: (n,) of the rows;
    residual: (n, d) there; data_hessian, prior_hessian: (p, p) Gauss-Newton J'WJ, dense or
    sparse; scatter2: estimated variance factor of the residuals (1 = as whitened).
    """

    x: X
    initial_cost: float
    cost: float
    iterations: int
    stop: Stop
    residual: Doubles
    weights: Doubles
    data_hessian: Any
    prior_hessian: Any
    scatter2: float

    def covariance(self, scatter2: float | None = None) -> Doubles:
        """(p, p) covariance of the delta at x; infinite everywhere where the data say nothing, or
        nothing that can be computed.

        scatter2: the variance factor if known better than from the residuals of this fit.
        """
        factor = self.scatter2 if scatter2 is None else scatter2
        hessian = self.data_hessian / max(factor, 1e-300) + self.prior_hessian
        dense = hessian.toarray() if _is_sparse(hessian) else hessian
        scale = np.sqrt(np.maximum(np.diag(dense), 1e-300))
        unknown = np.full(dense.shape, np.inf)
        try:
            values, vectors = np.linalg.eigh(dense / np.outer(scale, scale))
        except np.linalg.LinAlgError:
            return unknown
        if not values[0] >= 1e-14 * len(values):
            return unknown
        return (vectors / values) @ vectors.T / np.outer(scale, scale)


def minimize(
    problem: Problem[X], start: X, loss: Loss = Loss(), options: LmOptions = LmOptions()
) -> LmFit[X]:
    """The local minimum of sum rho(|r_i|^2) + |prior|^2 that is downhill from `start`.

    Marquardt damping with Nielsen's update ("Damping parameter in Marquardt's method", 1999).
    """
    here = _Linearized.around(_Tried.at(problem, start, loss), problem, loss)
    initial_cost, damping, growth = here.cost, options.damping, 2.0
    for iteration in range(1, options.max_iterations + 1):
        delta = here.damped_step(damping)
        predicted = here.predicted_gain(delta)
        if predicted <= options.cost_tolerance * here.cost:
            return here.fit(initial_cost, iteration, "gradient", loss)
        trial = _Tried.at(problem, problem.step(here.x, delta), loss)
        gained = here.cost - trial.cost
        if not gained > 0:
            damping, growth = damping * growth, growth * 2
            if damping > MOST_DAMPING:
                return here.fit(initial_cost, iteration, "stuck", loss)
            continue
        converged = gained <= options.cost_tolerance * here.cost
        here = _Linearized.around(trial, problem, loss)
        if converged:
            return here.fit(initial_cost, iteration, "cost", loss)
        damping = max(damping * max(1 / 3, 1 - (2 * gained / predicted - 1) ** 3), LEAST_DAMPING)
        growth = 2.0
    return here.fit(initial_cost, options.max_iterations, "iterations", loss)


@dataclass(frozen=True, eq=False)
class _Tried(Generic[X]):
    """An x with its residuals and its cost. prior: as of `Problem`."""

    x: X
    residual: Doubles
    prior: tuple[Doubles, Any]
    cost: float

    @classmethod
    def at(cls, problem: Problem[X], x: X, loss: Loss) -> _Tried[X]:
        residual, prior = problem.residual(x), problem.prior(x)
        cost = loss.cost(_squared_length(residual)).sum() + prior[0] @ prior[0]
        return cls(x, residual, prior, float(cost))


@dataclass(frozen=True, eq=False)
class _Linearized(Generic[X]):
    """The weighted Gauss-Newton model of the problem around x."""

    x: X
    cost: float
    residual: Doubles
    weights: Doubles
    data_hessian: Any
    prior_hessian: Any
    gradient: Doubles

    @classmethod
    def around(cls, tried: _Tried[X], problem: Problem[X], loss: Loss) -> _Linearized[X]:
        residual, (prior, prior_jacobian) = tried.residual, tried.prior
        s = _squared_length(residual)
        known = s < FAR**2
        weights = np.where(known, loss.weight(s), 0)
        clean = np.where(known[:, None], residual, 0)
        jacobian = problem.jacobian(tried.x)
        prior_hessian = prior_jacobian.T @ prior_jacobian
        if isinstance(jacobian, np.ndarray):
            jacobian = np.where(known[:, None, None], jacobian, 0).reshape(residual.size, -1)
            weighted = jacobian.T * np.repeat(weights, residual.shape[1])
            hessian, gradient = weighted @ jacobian, weighted @ clean.ravel()
        else:
            hessian, gradient = _summed(jacobian, clean, weights, prior_hessian.shape[0])
            prior_hessian = sparse.csc_array(prior_hessian)
        gradient = gradient + prior_jacobian.T @ prior
        return cls(tried.x, tried.cost, residual, weights, hessian, prior_hessian, gradient)

    def damped_step(self, damping: float) -> Doubles:
        hessian = self.data_hessian + self.prior_hessian
        if _is_sparse(hessian):
            diagonal = hessian.diagonal()
            hessian = hessian + sparse.diags(damping * np.maximum(diagonal, 1e-300))
            return splu(sparse.csc_matrix(hessian)).solve(-self.gradient)
        scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        scaled = hessian / np.outer(scale, scale) + damping * np.eye(len(scale))
        return np.linalg.solve(scaled, -self.gradient / scale) / scale

    def predicted_gain(self, delta: Doubles) -> float:
        hessian = self.data_hessian + self.prior_hessian
        return float(-2 * delta @ self.gradient - delta @ (hessian @ delta))

    def fit(self, initial_cost: float, iterations: int, stop: Stop, loss: Loss) -> LmFit[X]:
        s, d = _squared_length(self.residual), self.residual.shape[1]
        freedom = max(self.residual.size - len(self.gradient), 1)
        psi2 = float((loss.weight(s) ** 2 * s).sum()) / freedom
        slope = float((loss.weight(s) + 2 / d * loss.curvature(s)).sum()) / len(self.residual)
        scatter2 = psi2 * float(self.weights.mean()) / max(slope, 1e-3) ** 2
        return LmFit(
            self.x, initial_cost, self.cost, iterations, stop, self.residual, self.weights,
            self.data_hessian, self.prior_hessian, scatter2,
        )  # fmt: skip


def _summed(
    parts: Iterator[JacobianPart], clean: Doubles, weights: Doubles, width: int
) -> tuple[Any, Doubles]:
    """((p, p) sparse J'WJ, (p,) J'Wr) of the parts of a jacobian with p = width columns."""
    gradient = np.zeros(width)
    numbers, values = [np.zeros((2, 0), np.int32)], [np.zeros(0)]
    for part in parts:
        columns = part.columns.astype(np.int32)
        block = part.block.reshape(-1, len(columns))
        weighted = block.T * np.repeat(weights[part.rows], clean.shape[1])
        np.add.at(gradient, columns, weighted @ clean[part.rows].ravel())
        numbers.append(np.stack([np.repeat(columns, len(columns)), np.tile(columns, len(columns))]))
        values.append((weighted @ block).ravel())
    row, column = np.concatenate(numbers, axis=1)
    value = np.concatenate(values)
    return sparse.csc_array((value, (row, column)), (width, width)), gradient


def _is_sparse(matrix: Any) -> bool:
    return bool(sparse.issparse(matrix))


def _squared_length(residual: Doubles) -> Doubles:
    s = (residual**2).sum(axis=1)
    return np.minimum(np.where(np.isfinite(s), s, np.inf), FAR**2)
