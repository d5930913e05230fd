"""Do two photos show the same surface where their cameras put it? One is warped into the other
through the mesh, and patches are sought around the place where they should be.

Chance finds a patch within `PLACED_PX` in one of twenty searches; right cameras of real scenes find
seven of ten there and more, cameras off by one percent of the picture none (measured on two scenes
with known cameras).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.register.joint.ties import LEAST_SCORE
from texproj.register.proof.through_mesh import CLOSE_PX, LEAST_PATCHES, Lookup, shown

PLACED_PX = CLOSE_PX
"""A patch is in place if found this close, working pixels."""
AGREE, NOTHING = 0.3, 0.12
"""Share of the patches in place from which on a pair agrees, and up to which it does not: chance
gives 0.06."""


@dataclass(frozen=True, eq=False)
class PairAgreement:
    """Of `sought` patches, `placed` were in place; offset_px: (n,) how far from their place those
    that are alike beyond doubt were found, working pixels.
    """

    sought: int
    placed: int
    offset_px: Doubles

    @property
    def share(self) -> float:
        """Share of the patches found in place."""
        return self.placed / max(self.sought, 1)

    @property
    def tells(self) -> bool:
        """Whether there was enough to compare."""
        return self.sought >= LEAST_PATCHES

    @property
    def agrees(self) -> bool:
        return self.tells and self.share >= AGREE and self.exact_share >= 0.5

    @property
    def contradicts(self) -> bool:
        """Nothing is where it should be, or what is found is elsewhere."""
        displaced = len(self.offset_px) >= LEAST_PATCHES and self.exact_share < 0.5
        return self.tells and (self.share <= NOTHING or displaced)

    @property
    def exact_share(self) -> float:
        """Of the patches that were found, the share in place."""
        return float((self.offset_px < PLACED_PX).mean()) if len(self.offset_px) else 0.0


def compare_pair(i: int, j: int, views: Lookup) -> PairAgreement:
    """Photo j warped into photo i, patch by patch."""
    here = views[i]
    there = shown(here, views[j], to_the_rim=True)
    found = there.found_in(here.gradients)
    offset = np.linalg.norm(found.target_px - found.source_px, axis=1)
    placed = np.unique(found.patch[offset < PLACED_PX])
    return PairAgreement(len(there.centers), len(placed), offset[found.score >= LEAST_SCORE])
