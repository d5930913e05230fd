"""How sure the seven numbers of a placed block are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.register.block.decide import Judged, matched_fit, support_at, tightened
from texproj.register.block.placed_block import PatchFit, PlacedBlock
from texproj.register.block.surface_fit import Known, on_surface
from texproj.register.block.witnesses import Witness
from texproj.register.structure.solve import NEAR, explained_share
from texproj.solve.lm import LmFit

SYSTEMATIC = 1.0
"""Error that all patches share (light from above, mostly), relative to their median offset: so
large that points on relief, which know no light, lead: .09 % against .20 on a castle."""
CONTRADICTION = 0.6
"""Part of the distance between the places by structure and by points that is the latter's error."""
INLIER_PX = 3.0
"""Patches closer than this to their place tell that offset, pixels of the middle level."""
LAST_SCALES = (1.5, 1.0)
LEAST_PERCENT = 0.02
"""Of the photos' width: no expected error is smaller."""
STILL_FOUND = 0.7
"""Share of the patches found that must be found again where the points move the block to."""


@dataclass(frozen=True, eq=False)
class Certainty:
    """placed: the block after every photo asked, and its points, had their say; sigma: (7,) of
    rotation (rad), shift (mesh units), log scale; expected_percent: of the photos' width;
    support: mean share of patches that all photos asked show in place there; structure_percent: how
    far the place by the photos' structure alone is from it, which counts as an error of either.
    """

    placed: PlacedBlock
    sigma: Doubles
    expected_percent: float
    support: float
    structure_percent: float


def certainty(witnesses: Sequence[Witness], best: Judged) -> Certainty:
    """The last round at a place, and what its residuals tell of its error."""
    views = [w.view(best.placed.camera(w.in_block)) for w in witnesses]
    problem = matched_fit(witnesses, views, best.placed, NEAR, best.place)
    fit = tightened(problem, best.placed, LAST_SCALES)
    placed, covariance = fit.x, _inflated(problem, fit)
    if np.isfinite(covariance).all():
        proposer = best.place.proposer
        known = Known(placed, covariance, best.place.pivot, best.place.unit)
        refined = on_surface(proposer.cloud, proposer.scan.samples, known)
        if refined is not None and _agrees(problem, fit.x, refined[0]):
            placed, covariance = refined
    unit = np.array([1.0] * 3 + [best.place.unit] * 3 + [1.0])
    width = float(np.mean([photo.camera(placed).width for photo in problem.photos]))
    spread = 100 * _spread_px(problem, placed, covariance) / width
    moved = np.linalg.norm(problem.residual(placed) - problem.residual(fit.x), axis=1)
    contradiction = 100 * float(np.nanmean(moved)) / width
    expected = max(float(np.hypot(spread, CONTRADICTION * contradiction)), LEAST_PERCENT)
    sigma = np.sqrt(np.diag(covariance)[:7]) * unit * expected / max(spread, 1e-9)
    return Certainty(placed, sigma, expected, support_at(witnesses, views, placed), contradiction)


def _inflated(problem: PatchFit, fit: LmFit[PlacedBlock]) -> Doubles:
    """(8, 8) covariance; patches overlap, and share errors that more of them do not remove."""
    covariance = fit.covariance() * (NEAR.size_px / NEAR.step_px) ** 2
    spread = _spread_px(problem, fit.x, covariance)
    return covariance * (1 + (SYSTEMATIC * _scatter_px(fit) / max(spread, 1e-12)) ** 2)


def _agrees(problem: PatchFit, before: PlacedBlock, after: PlacedBlock) -> bool:
    """Whether the photos still show the structure in place."""
    return explained(problem, after) >= STILL_FOUND * explained(problem, before)


def explained(problem: PatchFit, placed: PlacedBlock) -> float:
    """Mean share, over photos, of the patches sought of which a match is where `placed` says."""
    return float(np.mean([explained_share(p.seen, p.camera(placed)) for p in problem.photos]))


def _spread_px(problem: PatchFit, placed: PlacedBlock, covariance: Doubles) -> float:
    """Standard deviation of the surface's image by a covariance, pixels of the level."""
    jacobian = problem.jacobian(placed)
    return float(np.sqrt(np.einsum("nip,pq,niq->n", jacobian, covariance, jacobian).mean()))


def _scatter_px(fit: LmFit[PlacedBlock]) -> float:
    distance = np.linalg.norm(fit.residual, axis=1)
    near = distance[distance < INLIER_PX]
    return float(np.median(near)) if len(near) else INLIER_PX
