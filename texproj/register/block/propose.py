"""Places on the mesh where a block of photos may belong, by its geometry alone.

Its points must lie on the mesh and its lines of sight be free. Coarse correlation over rotations
and scales, closest points for all that it found, lines of sight to rank them: method ours.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.mesh import Mesh
from texproj.register.block.cloud import Cloud
from texproj.register.block.correlation import correlated
from texproj.register.block.hypotheses import Hypotheses
from texproj.register.block.icp import Schedule, closest_points
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.rotations import spread_rotations
from texproj.register.block.scan import Scan
from texproj.register.block.sight_lines import SightLines
from texproj.register.block.similarity import Similarity
from texproj.register.block.upright import Upright

ROTATIONS = 552
"""About 30 degrees between neighbors: within the reach of the closest points."""
SCALE_BATCHES = ((1.04, 0.9, 1.2), (0.78, 1.38, 0.68, 1.6), (0.58, 1.85, 0.5, 2.2))
"""Sizes of the block relative to the mesh, the likeliest first."""
PART_SCALES = (1.0, 0.82, 1.22, 0.68)
"""The same where either is reduced to what it is about."""
WIDE = Schedule(160, (0.2, 0.2, 0.16, 0.13, 0.1, 0.08, 0.065, 0.05))
NEAR = Schedule(600, (0.08, 0.065, 0.05, 0.04, 0.04, 0.04))
EXACT = Schedule(2000, (0.03, 0.025, 0.02, 0.015, 0.012, 0.01, 0.01))
SHAKEN, COPIES = 60, 12
"""The best places are disturbed so many times each and followed once more, since closest points
stop at the first place that is better than all around it ..."""
SHAKE_RAD, SHAKE_SHIFT, SHAKE_LOG = 0.12, 0.08, 0.05
"""... by turns, shifts (sizes of the block) and logarithms of the scale of these deviations."""
AGAIN = Schedule(160, (0.12, 0.12, 0.1, 0.08, 0.065, 0.05))
KEPT = 500
"""Places that are worked on after the first closest points."""
SEEN = 30
"""Places that are worked out, after lines of sight were cast for all that were kept."""
ROUGH, FINE = 0.06, 0.03
"""Tolerance of a line of sight's end, sizes of the block."""
APART = 0.06
"""Two places closer than this are one, sizes of the block ..."""
PROBES = 60
"""... on average over so many points."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where a block may belong. sight: share of its lines of sight that end on the mesh minus the
    share that is blocked; pivot: (3,) the block's middle, world; unit:
    its size there, mesh units; proposer: by what it was found.
    """

    world_from_block: Similarity
    sight: float
    pivot: Doubles
    unit: float
    proposer: Proposer

    def gap(self, other: Place) -> float:
        """Mean distance between where two places put the points, sizes of the block."""
        cloud = self.proposer.cloud
        points = cloud.block_from_unit.apply(cloud.xyz[:PROBES])
        apart = self.world_from_block.apply(points) - other.world_from_block.apply(points)
        return float(np.linalg.norm(apart, axis=1).mean() / self.unit)


@dataclass(frozen=True, eq=False)
class Proposer:
    """A block's cloud and the mesh that it is compared with. seed: of what is left to chance;
    upright: where only such places are proposed; part: either is reduced to what it is about.
    """

    cloud: Cloud
    scan: Scan
    seed: int = 0
    upright: Upright | None = None
    part: bool = False

    def places(self, scales: tuple[float, ...]) -> list[Place]:
        """Distinct places at about these scales, those with the best lines of sight first.

        scales: sizes of the block relative to the mesh's.
        """
        samples, sight = self.scan.samples, SightLines(self.cloud, self.scan)
        probes = self.cloud.xyz[:PROBES]
        coarse = correlated(self.cloud, samples, self._rotations(), scales)
        wide = self._closest(coarse, WIDE).best(KEPT)
        shaken = wide.distinct(probes, APART)[:SHAKEN].shaken(
            COPIES, (SHAKE_RAD, SHAKE_SHIFT, SHAKE_LOG), self.seed
        )
        again = Hypotheses.joined([wide, self._closest(shaken, AGAIN)]).best(KEPT)
        near = self._closest(again, NEAR)
        seen = sight.ranked(near, ROUGH).distinct(probes, APART)[:SEEN]
        exact = sight.ranked(self._closest(seen, EXACT), FINE).distinct(probes, APART)
        return [self._place(exact, i) for i in range(len(exact))]

    def _rotations(self) -> Doubles:
        """(n, 3, 3) those that are tried. Cloud and scan are turned as block and world are."""
        every = spread_rotations(ROTATIONS)
        return every if self.upright is None else every[self.upright.holds(every)]

    def _closest(self, places: Hypotheses, schedule: Schedule) -> Hypotheses:
        cloud = self.cloud
        return closest_points(places, cloud.xyz, cloud.toward, self.scan.samples, schedule)

    def _place(self, places: Hypotheses, i: int) -> Place:
        world_from_unit = self.scan.samples.world_from_unit @ places.similarity(i)
        return Place(
            world_from_unit @ self.cloud.block_from_unit.inverse,
            float(places.score[i]),
            world_from_unit.t,
            world_from_unit.scale,
            self,
        )


def proposers(
    block: Reconstruction, mesh: Mesh, cloud: Cloud, scan: Scan, seed: int,
    upright: Upright | None = None,
) -> Iterator[Proposer]:  # fmt: skip
    """All of the block with all of the mesh, the upright places first where that is known; then,
    where either shows much besides what it is about, only that. Each is made when it is asked for.
    """
    if upright is not None:
        yield Proposer(cloud, scan, seed, upright)
    yield Proposer(cloud, scan, seed)
    aimed, relief = Cloud.aimed_at(block, seed), scan.relief(mesh, seed)
    if aimed is not None:
        yield Proposer(aimed, scan, seed, part=True)
    if relief is not None:
        yield Proposer(cloud, relief, seed, part=True)
    if aimed is not None and relief is not None:
        yield Proposer(aimed, relief, seed, part=True)
