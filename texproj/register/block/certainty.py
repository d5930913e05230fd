"""How sure the seven numbers of a placed block are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.register.block.decide import Judged, matched_fit, tightened
from texproj.register.block.placed_block import PatchFit, PlacedBlock
from texproj.register.block.witnesses import Witness
from texproj.register.structure.solve import NEAR
from texproj.solve.lm import LmFit

SYSTEMATIC = 0.45
"""Error that all patches share (light from above, mostly), relative to their median offset."""
INLIER_PX = 3.0
"""Patches closer than this to their place tell that offset, pixels of the middle level."""
LAST_SCALES = (1.5, 1.0)


@dataclass(frozen=True, eq=False)
class Certainty:
    """placed: the block after a last round in which every photo asked took part; sigma: (7,) of
    rotation (rad), shift (mesh units), log scale; expected_percent: of the photos' width.
    """

    placed: PlacedBlock
    sigma: Doubles
    expected_percent: float


def certainty(witnesses: Sequence[Witness], best: Judged) -> Certainty:
    """The last round at a place, and what its residuals tell of its error."""
    views = [w.view(best.placed.camera(w.in_block)) for w in witnesses]
    problem = matched_fit(witnesses, views, best.placed, NEAR, best.place)
    fit = tightened(problem, best.placed, LAST_SCALES)
    covariance = fit.covariance() * (NEAR.size_px / NEAR.step_px) ** 2
    width = float(np.mean([photo.camera(fit.x).width for photo in problem.photos]))
    spread = _spread_px(problem, fit, covariance)
    expected = float(np.hypot(spread, SYSTEMATIC * _scatter_px(fit)))
    unit = np.array([1.0] * 3 + [best.place.unit] * 3 + [1.0])
    sigma = np.sqrt(np.diag(covariance)[:7]) * unit * expected / max(spread, 1e-12)
    return Certainty(fit.x, sigma, 100 * expected / width)


def _spread_px(problem: PatchFit, fit: LmFit[PlacedBlock], covariance: Doubles) -> float:
    """Standard deviation of the surface's image by a covariance, pixels of the level."""
    jacobian = problem.jacobian(fit.x)
    return float(np.sqrt(np.einsum("nip,pq,niq->n", jacobian, covariance, jacobian).mean()))


def _scatter_px(fit: LmFit[PlacedBlock]) -> float:
    distance = np.linalg.norm(fit.residual, axis=1)
    near = distance[distance < INLIER_PX]
    return float(np.median(near)) if len(near) else INLIER_PX
