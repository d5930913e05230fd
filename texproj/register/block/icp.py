"""Iterated closest points for many places at once, with a scale: seven unknowns each.

Point to plane (Chen and Medioni 1992) with a Geman-McClure loss that tightens round by round
(graduated non-convexity, Black and Rangarajan 1996). Distances are counted in sizes of the
block, so that shrinking onto a patch of the mesh gains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Floats
from texproj.register.block.hypotheses import Hypotheses
from texproj.register.block.rotations import exponentials
from texproj.register.block.scan_samples import NearestTable, ScanSamples

CHUNK = 40_000
"""Points times places worked on at once: what stays in the processor's cache."""
DAMPING = 1e-3
"""Added to the normal equations, relative to the points that count: what nothing holds stays."""
MOST_TURN, MOST_GROWTH = 0.3, 0.06
"""Largest step of one round: radians (and sizes of the block), logarithm of the scale."""
MOST_RESCALED = 0.2
"""Logarithm of the scale by which a place may leave its start."""
GRAZING = 0.05
"""Cosine between a surface's outside and the line of sight below which it is not seen."""


@dataclass(frozen=True)
class Schedule:
    """points: how many of the block's points are used; scales: of the loss, one per round, sizes
    of the block.
    """

    points: int
    scales: tuple[float, ...]


def closest_points(
    places: Hypotheses, xyz: Floats, toward: Floats, scan: ScanSamples, schedule: Schedule
) -> Hypotheses:
    """The places that `places` lead to; their score is the mean weight of the points, 0 .. 1.

    xyz, toward: (n, 3) points of the block and unit directions from which they were seen.
    """
    xyz, toward = xyz[: schedule.points], toward[: schedule.points]
    each = max(1, CHUNK // len(xyz))
    parts = [
        _Rounds(xyz, toward, scan, scan.table).run(places[k : k + each], schedule.scales)
        for k in range(0, len(places), each)
    ]
    return Hypotheses.joined(parts)


@dataclass(frozen=True, eq=False)
class _Rounds:
    xyz: Floats
    toward: Floats
    scan: ScanSamples
    table: NearestTable

    def run(self, start: Hypotheses, scales: tuple[float, ...]) -> Hypotheses:
        here = start
        for scale in scales:
            step, score = self._step(here, scale)
            here = _moved(here, step, start, score)
        return here

    def _step(self, places: Hypotheses, loss: float) -> tuple[Floats, Floats]:
        """(h, 7) turn about the block's middle, shift in sizes of the block, log scale; and the
        (h,) mean weight before it.
        """
        size = places.scale.astype(np.float32)[:, None]
        placed = places.apply(self.xyz)
        nearest, known = self.table(placed)
        gap = (placed - self.scan.xyz[nearest]) / size[..., None]
        normal = self.scan.normal[nearest]
        seen_from = self.toward @ places.R.astype(np.float32).transpose(0, 2, 1)
        faces = np.einsum("hnk,hnk->hn", normal, seen_from) > GRAZING
        plane = np.einsum("hnk,hnk->hn", gap, normal)
        blur = (self.table.cell / size) ** 2  # of the nearest sample, not of the plane
        aside = np.maximum(np.einsum("hnk,hnk->hn", gap, gap) - plane**2 - blur, 0)
        weight = (loss**2 / (loss**2 + plane**2 + aside)) ** 2
        weight *= known & faces & self.scan.partner[nearest]
        arm = (placed - places.t[:, None].astype(np.float32)) / size[..., None]
        growth = np.einsum("hnk,hnk->hn", arm, normal)[..., None]
        jacobian = np.concatenate([_cross(arm, normal), normal, growth], axis=2)
        weighted = (jacobian * weight[..., None]).transpose(0, 2, 1)
        hessian = weighted @ jacobian + np.float32(DAMPING * len(self.xyz)) * np.eye(
            7, dtype=np.float32
        )
        step = np.linalg.solve(hessian, -weighted @ plane[..., None])[..., 0]
        return step, weight.mean(axis=1)


def _cross(a: Floats, b: Floats) -> Floats:
    """(..., 3) cross products; numpy's own is several times slower."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _moved(here: Hypotheses, step: Floats, start: Hypotheses, score: Floats) -> Hypotheses:
    delta = step.astype(np.float64)
    length = np.maximum(np.linalg.norm(delta[:, :3], axis=1), np.linalg.norm(delta[:, 3:6], axis=1))
    delta[:, :6] *= np.minimum(1, MOST_TURN / np.maximum(length, 1e-12))[:, None]
    log = np.log(here.scale) + np.clip(delta[:, 6], -MOST_GROWTH, MOST_GROWTH)
    origin = np.log(start.scale)
    scale = np.exp(np.clip(log, origin - MOST_RESCALED, origin + MOST_RESCALED))
    t = here.t + here.scale[:, None] * delta[:, 3:6]
    return Hypotheses(exponentials(delta[:, :3]) @ here.R, scale, t, score.astype(np.float64))
