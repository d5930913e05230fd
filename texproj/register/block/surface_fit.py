"""The last word on a block's place: its points on the mesh's surface, and the photos' structure.

Thousands of points average their noise and know no bias by light; the structure holds what they
leave open, as along a flat wall. Point to plane with a robust loss, structure as a prior: ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from texproj.arrays import Bools, Doubles, Index
from texproj.register.block.cloud import Cloud
from texproj.register.block.placed_block import PlacedBlock
from texproj.register.block.scan_samples import ScanSamples
from texproj.register.block.similarity import Similarity
from texproj.solve.lm import LmOptions, Loss, minimize

POINTS = 6000
REACHES = (0.03, 0.03, 0.02, 0.02, 0.015, 0.015)
"""Distance, sizes of the block, up to which points belong to the surface, round by round."""
LEAST_POINTS = 50
LEAST_SIGMA = 2e-4
"""No scan and no lens is known better, sizes of the block."""
CORRELATED = 5.0
"""How many points share an error (shape of the mesh, bending of the block); what is known weighs
so much more."""
LOSS = Loss("cauchy", 2.0)
STEPS = LmOptions(max_iterations=15, cost_tolerance=1e-5)


@dataclass(frozen=True, eq=False)
class Known:
    """What the photos' structure says of a block: where it is and the (8, 8) covariance of
    `PatchFit`'s unknowns, about `pivot` (3,) world, lengths in `unit`.
    """

    placed: PlacedBlock
    covariance: Doubles
    pivot: Doubles
    unit: float

    def away(self, x: PlacedBlock) -> Doubles:
        """(8,) the unknowns' step that leads from there to `x`."""
        step = x.world_from_block @ self.placed.world_from_block.inverse
        turn = cv2.Rodrigues(np.ascontiguousarray(step.R))[0].ravel()
        shift = (step.apply(self.pivot[None])[0] - self.pivot) / self.unit
        focal = x.log_focal - self.placed.log_focal
        return np.concatenate([turn, shift, [float(np.log(step.scale)), focal]])


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """Distances of points (n, 3), block, from the planes (n, 3), (n, 3), world, that they lie on,
    in standard deviations `sigma`, mesh units; the unknowns are `PatchFit`'s.
    """

    xyz_in_block: Doubles
    on_plane: Doubles
    normal: Doubles
    sigma: float
    known: Known

    def residual(self, x: PlacedBlock) -> Doubles:
        gap = x.world_from_block.apply(self.xyz_in_block) - self.on_plane
        return np.einsum("ij,ij->i", gap, self.normal)[:, None] / self.sigma

    def jacobian(self, x: PlacedBlock) -> Doubles:
        arm = x.world_from_block.apply(self.xyz_in_block) - self.known.pivot
        turn = np.cross(arm, self.normal)
        growth = np.einsum("ij,ij->i", arm, self.normal)[:, None]
        columns = [turn, self.known.unit * self.normal, growth, np.zeros_like(growth)]
        return np.concatenate(columns, axis=1)[:, None] / self.sigma

    def step(self, x: PlacedBlock, delta: Doubles) -> PlacedBlock:
        moved = x.world_from_block.step(delta[:7], self.known.pivot, self.known.unit)
        return PlacedBlock(moved, x.log_focal + float(np.clip(delta[7], -0.1, 0.1)))

    def prior(self, x: PlacedBlock) -> tuple[Doubles, Doubles]:
        root = np.linalg.inv(np.linalg.cholesky(self.known.covariance / CORRELATED))
        return root @ self.known.away(x), root


def on_surface(
    cloud: Cloud, samples: ScanSamples, known: Known
) -> tuple[PlacedBlock, Doubles] | None:
    """The block where its points and what is known put it, and the (8, 8) covariance of the
    unknowns; None if too few points meet the mesh.
    """
    placed = known.placed
    xyz = cloud.block_from_unit.apply(cloud.xyz[:POINTS])
    for reach in REACHES:
        problem = _paired(xyz, cloud, samples, known, placed, reach)
        if problem is None:
            return None
        fit = minimize(problem, placed, LOSS, STEPS)
        placed = fit.x
    covariance: Doubles = CORRELATED * fit.covariance(1.0)
    return placed, covariance


def _paired(
    xyz: Doubles,
    cloud: Cloud,
    samples: ScanSamples,
    known: Known,
    placed: PlacedBlock,
    reach: float,
) -> SurfaceFit | None:
    """Each point with the plane of the nearest sample that faces its cameras."""
    to_unit = samples.world_from_unit.inverse @ placed.world_from_block
    distance, nearest = samples.tree.query(
        to_unit.apply(xyz), distance_upper_bound=reach * known.unit / samples.world_from_unit.scale
    )
    met = np.isfinite(distance)
    nearest = np.where(met, nearest, 0)
    met &= samples.partner[nearest] & faces_cameras(cloud, samples, to_unit, nearest)
    if met.sum() < LEAST_POINTS:
        return None
    on_plane = samples.world_from_unit.apply(samples.xyz[nearest[met]])
    normal = samples.normal[nearest[met]].astype(np.float64)
    gap = placed.world_from_block.apply(xyz[met]) - on_plane
    off = np.abs(np.einsum("ij,ij->i", gap, normal))
    sigma = max(1.4826 * float(np.median(off)), LEAST_SIGMA * known.unit)
    return SurfaceFit(xyz[met], on_plane, normal, sigma, known)


def faces_cameras(cloud: Cloud, samples: ScanSamples, to_unit: Similarity, nearest: Index) -> Bools:
    """(n,) whether the samples `nearest` to the first n points face the cameras that saw these."""
    seen_from = cloud.toward[: len(nearest)] @ to_unit.R.T.astype(np.float32)
    return np.einsum("ij,ij->i", samples.normal[nearest], seen_from) > 0
