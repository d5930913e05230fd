"""One camera from pairs with unknown noise and gross outliers: inliers, noise and fit together.

Least squares over the inliers, the noise from their residuals, the inliers from the noise,
until nothing changes; a description length says which of several such answers is best.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.solve.lm import LmFit, LmOptions, Loss, minimize
from texproj.solve.reprojection import Reprojection

INLIER_LIMIT = -2 * math.log(0.001)
"""Squared deviation, in its own standard deviations, beyond which a pair is an outlier: a good
pair with Gaussian noise is lost once in a thousand (chi-square, two degrees of freedom)."""

NOISE_FREEDOM = 2.0
"""Weight of the nominal noise, in scalar residuals, against the noise that the residuals show."""

ROUNDS = 15


@dataclass(frozen=True)
class Noise:
    """What is expected of the pixels of picks.

    nominal_px: usual standard deviation per coordinate; gross_px: no inlier is further away
    in the first round; picture_px2: area over which outliers spread.
    """

    nominal_px: float
    gross_px: float
    picture_px2: float


@dataclass(frozen=True, eq=False)
class Estimate:
    """A camera solved from the pairs that agree with it.

    camera; inliers: (n,) bool; offset_px: (n, 2) projected minus given; sigma_px: noise per
    coordinate; freedom: scalar residuals beyond the parameters, the nominal noise's included;
    covariance: (p, p) of the step; length: description length, lower is better; fit: of the LM;
    fit_points: (k, 3) world points of the inliers.
    """

    camera: Camera
    inliers: NDArray[np.bool_]
    offset_px: Doubles
    sigma_px: float
    freedom: float
    covariance: Doubles
    length: float
    fit: LmFit[Camera]
    fit_points: Doubles

    def sigma_of(self, free: tuple[str, ...], name: str) -> float:
        """Standard deviation of the intrinsic `name` among those in `free`."""
        i = 6 + free.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    @property
    def distance_px(self) -> Doubles:
        """(n,) lengths of the offsets, inf where a point does not project."""
        return np.nan_to_num(np.linalg.norm(self.offset_px, axis=1), nan=np.inf)


def robust_estimate(problem: Reprojection, start: Camera, noise: Noise) -> Estimate | None:
    """The estimate that `start` leads to; None if fewer than four pairs, or a degenerate set,
    support it.

    Tried from a wide fit as well as from a narrow one: the narrow one is drawn to the few pairs
    that happen to agree, the wide one by outliers; the shorter description is kept.
    """
    wide = _annealed(problem, start, (noise.gross_px / 3,), noise)
    narrow = _annealed(problem, wide, (3 * noise.nominal_px, noise.nominal_px), noise)
    found = [_settled(problem, camera, noise) for camera in (wide, narrow)]
    sound = [e for e in found if e is not None and np.isfinite(e.length)]
    return min(sound, key=lambda e: e.length, default=None)


def _settled(problem: Reprojection, start: Camera, noise: Noise) -> Estimate | None:
    """Fit, noise and inliers in turn, from `start` until the inliers stay."""
    distance = _distance(problem, start)
    near = distance < noise.gross_px
    if near.sum() < 4:
        return None
    spread = float(np.median(distance[near])) / 1.1774  # median of a 2D Gaussian's length
    inliers = distance < max(3 * max(spread, noise.nominal_px), np.sort(distance)[3] * 1.01)
    estimate = _fitted(problem, start, inliers, noise)
    seen = {inliers.tobytes()}
    for _ in range(ROUNDS):
        if not np.isfinite(estimate.length):
            return None
        inliers = deviation2(problem, estimate) < INLIER_LIMIT
        if inliers.sum() < 4 or inliers.tobytes() in seen:
            return estimate
        seen.add(inliers.tobytes())
        estimate = _fitted(problem, estimate.camera, inliers, noise)
    return estimate


def deviation2(problem: Reprojection, estimate: Estimate) -> Doubles:
    """(n,) squared offset in units of its own covariance: the noise, less what the fit absorbed
    for inliers, plus the prediction's uncertainty for the others; inf where undefined.
    """
    scaled = replace(problem, sigma_px=estimate.sigma_px)
    offset = estimate.offset_px / estimate.sigma_px
    jacobian = scaled.jacobian(estimate.camera)
    absorbed = jacobian @ estimate.covariance @ jacobian.transpose(0, 2, 1)
    sign = np.where(estimate.inliers, -1.0, 1.0)[:, None, None]
    values, vectors = np.linalg.eigh(np.eye(2) + sign * absorbed)
    # a pick that nothing else checks has no deviation of its own: floor its variance
    along = np.einsum("nij,ni->nj", vectors, np.nan_to_num(offset))
    d2 = (along**2 / np.maximum(values, 0.05)).sum(axis=1)
    return np.where(np.isfinite(offset).all(axis=1), d2, np.inf)


def _annealed(
    problem: Reprojection, camera: Camera, scales_px: tuple[float, ...], noise: Noise
) -> Camera:
    """`camera` after Cauchy fits of these scales over the pairs that are not far away."""
    for scale in scales_px:
        near = _distance(problem, camera) < 8 * noise.gross_px
        if near.sum() < 4:
            return camera
        local = replace(
            problem, xy_px=problem.xy_px[near], xyz_in_world=problem.xyz_in_world[near],
            sigma_px=scale,
        )  # fmt: skip
        camera = minimize(local, camera, Loss("cauchy", 1.0), LmOptions(25, 1e-5)).x
    return camera


def _fitted(
    problem: Reprojection, camera: Camera, inliers: NDArray[np.bool_], noise: Noise
) -> Estimate:
    """Least squares over the inliers with the noise that their residuals show."""
    sigma = noise.nominal_px
    chosen = replace(
        problem, xy_px=problem.xy_px[inliers], xyz_in_world=problem.xyz_in_world[inliers]
    )
    for _ in range(6):
        fit = minimize(replace(chosen, sigma_px=sigma), camera)
        camera = fit.x
        before, sigma = sigma, _noise_px(fit, sigma, noise)
        if abs(sigma - before) < 1e-3 * sigma:
            break
    offset = problem.residual(camera) * problem.sigma_px
    freedom = _freedom(fit) + NOISE_FREEDOM
    covariance = fit.covariance(scatter2=(sigma / before) ** 2)
    length = _length(offset, inliers, sigma, noise) + _prior_length(problem, camera, covariance)
    return Estimate(
        camera, inliers, offset, sigma, freedom, covariance, length, fit, chosen.xyz_in_world
    )


def _freedom(fit: LmFit[Camera]) -> float:
    """Scalar residuals less the parameters that the data, not the priors, determine."""
    whole = fit.data_hessian + fit.prior_hessian
    scale = np.sqrt(np.maximum(np.diag(whole), 1e-300))
    normal = np.outer(scale, scale)
    taken = np.trace(np.linalg.pinv(whole / normal) @ (fit.data_hessian / normal))
    return max(fit.residual.size - float(taken), 0.0)


def _noise_px(fit: LmFit[Camera], sigma: float, noise: Noise) -> float:
    total = float((fit.residual**2).sum()) * sigma**2 + NOISE_FREEDOM * noise.nominal_px**2
    return float(np.sqrt(total / (_freedom(fit) + NOISE_FREEDOM)))


def _length(offset: Doubles, inliers: NDArray[np.bool_], sigma: float, noise: Noise) -> float:
    """-2 log likelihood: Gaussian inliers, outliers anywhere in the picture."""
    k = int(inliers.sum())
    gaussian = 2 * k * np.log(2 * np.pi * sigma**2) + (offset[inliers] ** 2).sum() / sigma**2
    nominal = NOISE_FREEDOM * (2 * np.log(sigma) + (noise.nominal_px / sigma) ** 2)
    return float(gaussian + nominal + (len(inliers) - k) * 2 * np.log(noise.picture_px2))


def _prior_length(problem: Reprojection, camera: Camera, covariance: Doubles) -> float:
    """-2 log of prior density times posterior volume: what freeing intrinsics costs (Laplace's
    approximation of the evidence; MacKay, "Bayesian interpolation", 1992).
    """
    residual = problem.prior(camera)[0]
    if not np.isfinite(covariance).all():
        return float("inf")
    sigmas = [p.sigma for p in problem.priors if p.name in problem.free]
    volume = np.linalg.slogdet(covariance[6:, 6:])[1] if problem.free else 0.0
    return float(residual @ residual + 2 * np.log(sigmas).sum() - volume)


def _distance(problem: Reprojection, camera: Camera) -> Doubles:
    offset = problem.residual(camera) * problem.sigma_px
    return np.nan_to_num(np.linalg.norm(offset, axis=1), nan=np.inf)
