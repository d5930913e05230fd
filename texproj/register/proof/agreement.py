"""Do two photos show one surface through the mesh, more than chance lets any two photos do?

One photo is warped into the other through the mesh. Where both cameras are about right, most of
its patches are found displaced by one and the same small vector; where one is wrong, anywhere. What
chance does with these very photos is measured, not assumed: the same patches are sought at places
that they do not belong to. Method: ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from texproj.arrays import Bools, Doubles, Index
from texproj.register.proof.through_mesh import (
    CLOSE_PX,
    LEAST_PATCHES,
    RADIUS_PX,
    Lookup,
    shown,
)
from texproj.solve.matching import PatchMatches

WORKING_PX = 512
"""Longer side of the reduced photos: all lengths here are for this size."""
TOGETHER_PX = CLOSE_PX
"""Patches displaced alike within this distance agree."""
ASIDE_PX = 3 * RADIUS_PX
"""How far off patches are sought for what chance does."""
LEAST_CHANCE = 0.08
"""No smaller share is taken for chance: that of the largest group of vectors in the window."""
AGREE, ODDS = 0.25, 1e-5
"""Share that agrees, and probability that chance does as well, from which on a pair agrees: right
cameras of real scenes have .3 to .9, wrong ones .05 to .16."""
CHANCE_ODDS = 1e-3
"""Probability of chance above which it explains what agrees ..."""
RIGHT_SHARE, RIGHT_ODDS = 0.35, 0.02
"""... and share that right cameras have at least, with the probability below which they do not
explain it: then a pair shows nothing of the same."""


@dataclass(frozen=True)
class Agreement:
    """Of `sought` patches `together` were displaced alike, by `apart_px` pixels of the working
    size; chance: the share that does so at places where they do not belong.
    """

    sought: int
    together: int
    chance: float
    apart_px: float = 0.0

    @property
    def share(self) -> float:
        return self.together / max(self.sought, 1)

    @property
    def tells(self) -> bool:
        """Whether there was enough to compare."""
        return self.sought >= LEAST_PATCHES

    @property
    def odds(self) -> float:
        """Probability that chance brings so many together."""
        return float(special.bdtrc(self.together - 1, self.sought, self.chance))

    @property
    def agrees(self) -> bool:
        return self.tells and self.share >= AGREE and self.odds <= ODDS

    @property
    def contradicts(self) -> bool:
        """Chance explains what agrees, right cameras do not."""
        right = float(special.bdtr(self.together, self.sought, RIGHT_SHARE))
        return self.tells and self.odds >= CHANCE_ODDS and right < RIGHT_ODDS


def agreement(i: int, j: int, views: Lookup) -> Agreement:
    """Photo j warped into photo i, patch by patch."""
    here = views[i]
    there = shown(here, views[j], to_the_rim=False)
    together, apart = _together(there.found_in(here.gradients))
    aside, left = _aside(there.solid, there.centers)
    by_chance, _ = _together(there.found_in(np.roll(here.gradients, aside, axis=(1, 0)), left))
    chance = max(LEAST_CHANCE, by_chance / len(left) if len(left) >= LEAST_PATCHES else 0.0)
    return Agreement(len(there.centers), together, chance, apart)


def _together(found: PatchMatches) -> tuple[int, float]:
    """How many patches are displaced alike, and by how much."""
    shift = found.target_px - found.source_px
    if not len(shift):
        return 0, 0.0
    near = _near(shift)
    best = int(near.sum(axis=1).argmax())
    apart = float(np.linalg.norm(np.median(shift[near[best]], axis=0)))
    return int(near[best].sum()), apart


def _near(shift: Doubles) -> Bools:
    """(n, n) which of (n, 2) vectors are alike."""
    gap: Bools = np.linalg.norm(shift[:, None] - shift[None], axis=2) < TOGETHER_PX
    return gap


def _aside(solid: Bools, centers: Index) -> tuple[tuple[int, int], Index]:
    """A vector to places where patches do not belong, negative, and those of the centers that
    still meet the surface there.
    """
    tried = []
    for dx, dy in ((ASIDE_PX, 0), (0, ASIDE_PX), (-ASIDE_PX, 0), (0, -ASIDE_PX)):
        x, y = centers.T + np.array([[dx], [dy]])
        inside = (x >= 0) & (y >= 0) & (x < solid.shape[1]) & (y < solid.shape[0])
        inside[inside] = solid[y[inside], x[inside]]
        tried.append(((-dx, -dy), centers[inside]))
    return max(tried, key=lambda one: len(one[1]))
