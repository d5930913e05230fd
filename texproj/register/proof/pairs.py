"""Do two photos show the same surface where their cameras put it? One is warped into the other
through the mesh, and patches are sought around the place where they should be.

Chance finds a patch within `PLACED_PX` in one of twenty searches; right cameras of real scenes find
seven of ten there and more, cameras off by one percent of the picture none (measured on two scenes
with known cameras).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from texproj.arrays import Doubles
from texproj.register.joint.ties import (
    LEAST_SCORE,
    PATCH_PX,
    RIM_PX,
    corner_grid,
    gradient_field,
)
from texproj.register.proof.texture import textured
from texproj.register.proof.through_mesh import Lookup, thinned, warped
from texproj.solve.matching import match_patches

RADIUS_PX = 8
PLACED_PX = 2.0
"""A patch is in place if found this close, working pixels."""
MOST_PATCHES = 160
"""Of each pair, spread evenly: enough to tell any share to some percent."""
LEAST_PATCHES = 25
"""Patches below which a pair says nothing."""
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
    here, other = views[i], views[j]
    there, shared = warped(here, other)
    kernel = np.ones((2 * RIM_PX + 1,) * 2, np.uint8)
    solid = cv2.erode((shared & textured(here.gray)).astype(np.uint8), kernel) > 0
    centers = thinned(corner_grid(here.corners, solid), MOST_PATCHES)
    found = match_patches(gradient_field(there), here.gradients, centers, PATCH_PX, RADIUS_PX)
    offset = np.linalg.norm(found.target_px - found.source_px, axis=1)
    placed = np.unique(found.patch[offset < PLACED_PX])
    return PairAgreement(len(centers), len(placed), offset[found.score >= LEAST_SCORE])
