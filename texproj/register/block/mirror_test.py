"""Is the scan, or are the photos, the wrong way round? Of a symmetric thing the mirror image fits
nearly as well, in shape and in the photos' structure; fine detail tells, over several photos, and
where the scan has none its surface.

The block and its photos are mirrored and placed at the same size; the shares of small patches in
place are compared photo by photo, as pairs. Method: ours; the test is Student's, two tests count as
one by Stouffer's rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Doubles
from texproj.register.block.cloud import Cloud
from texproj.register.block.decide import Judged, judged
from texproj.register.block.mirror_surface import surface_t
from texproj.register.block.propose import Proposer
from texproj.register.block.witnesses import Witness
from texproj.register.structure.mirror import FLIP
from texproj.register.structure.solve import found_share
from texproj.register.structure.verdict import DETAIL_WITHIN_PX, DETAILS

LEAST_LIKENESS = 0.5
"""Lines of sight of the mirrored block, and its patches, relative to those of the block itself,
below which there is no symmetry to speak of."""
ALIKE = 0.8
"""Share of patches in place, relative to the block's own, from which on no better place of the
mirrored block is looked for."""
TRIED = 3
REFUSED_T, SURE_T = -3.0, 3.0
"""Of the photos' details: below the first the mirror image is right; above the second it is
wrong."""
UNLIKELY_T = -1.5
"""Between them the surface is asked: the place is refused where that, or both together, has less.
Of a courtyard in a scan that was cut, with a fifth of its faces and noise, the right way round both
together had 1.2 to 3.2 and the surface 1.0 to 3.1, mirrored -3.8 to -.1 and -3.0 to -.2."""
NO_SYMMETRY_T = 99.0
"""What is reported where the mirror image does not fit at all."""
LEAST_SCATTER = 1e-3
"""Least standard deviation of the difference in one photo."""


@dataclass(frozen=True)
class MirrorTest:
    """t: Student's t of the pairs, positive where the photos are the right way round;
    differences: of each photo; by_surface: Student's t of the scan's surface, where it was asked.
    """

    t: float
    differences: tuple[float, ...] = ()
    by_surface: float | None = None

    @property
    def together(self) -> float:
        """Of both."""
        return self.t if self.by_surface is None else (self.t + self.by_surface) / np.sqrt(2)

    @property
    def refused(self) -> bool:
        if self.by_surface is None:
            return self.t < REFUSED_T
        return min(self.by_surface, self.together) < UNLIKELY_T

    @property
    def undecided(self) -> bool:
        return not self.refused and max(self.t, self.together) < SURE_T


def mirrored_cloud(cloud: Cloud) -> Cloud:
    """The cloud of the block mirrored at x = 0 of its own frame."""
    flip = FLIP.astype(np.float32)
    placed = cloud.block_from_unit
    return Cloud(
        replace(placed, t=FLIP @ placed.t), cloud.xyz @ flip, cloud.eye @ flip, cloud.toward @ flip
    )


def mirror_test(witnesses: Sequence[Witness], asked: int, own: Judged) -> MirrorTest:
    """own: the place that is tested, found by the first `asked` of the photos."""
    others = [witness.mirrored for witness in witnesses]
    rival = _rival(own.place.proposer, others[:asked], own)
    if rival is None:
        return MirrorTest(NO_SYMMETRY_T)
    pairs = zip(_details(witnesses, own), _details(others, rival), strict=True)
    differences = tuple(a - b for a, b in pairs)
    t = _student(np.array(differences))
    if not REFUSED_T <= t < SURE_T:
        return MirrorTest(t, differences)
    cloud = own.place.proposer.cloud
    by_surface = surface_t(cloud, own, mirrored_cloud(cloud), rival)
    return MirrorTest(t, differences, by_surface)


def _rival(proposer: Proposer, others: Sequence[Witness], own: Judged) -> Judged | None:
    """The best place of the mirrored block at the size that the block has; None if none is like
    the block's own.
    """
    mirrored = replace(proposer, cloud=mirrored_cloud(proposer.cloud))
    size = own.place.unit / proposer.scan.samples.world_from_unit.scale
    best: Judged | None = None
    for place in mirrored.places((size,))[:TRIED]:
        if place.sight < LEAST_LIKENESS * own.place.sight:
            break
        here = judged(others, place)
        if here.support >= max(LEAST_LIKENESS * own.support, best.support if best else 0.0):
            best = here
        if best and best.support >= ALIKE * own.support:
            break
    return best


def _details(witnesses: Sequence[Witness], at: Judged) -> list[float]:
    """For each photo the share of small patches in place, over their sizes and what counts."""
    shares = []
    for witness in witnesses:
        camera = at.placed.camera(witness.in_block)
        view = witness.view(camera)
        seen = [view.observe(camera, rule) for rule in DETAILS]
        shares.append(float(np.mean([found_share(s, px) for s in seen for px in DETAIL_WITHIN_PX])))
    return shares


def _student(differences: Doubles) -> float:
    """Student's t of the mean of (n,) differences; 0 for less than two."""
    n = len(differences)
    if n < 2:
        return 0.0
    scatter = max(float(differences.std(ddof=1)), LEAST_SCATTER)
    return float(differences.mean() * np.sqrt(n) / scatter)
