"""Which way up a block belongs: cameras have measured it, or are held level on the mean, and
somebody said which way is up on the mesh. It orders places and breaks ties; it forbids none.
Method: ours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from texproj.arrays import Bools, Doubles
from texproj.register.block.reconstruction import Reconstruction
from texproj.standing import upward

LEVEL_DEG = 60.0
"""Tilt up to which a place is upright: photos that look up or down from one side say no more than
that, and the rotations tried are 30 degrees apart."""
LESS_LIKELY = 0.35
"""What the support of a place that is not upright counts for beside one that is: of two that fit
equally the upright one has the lead that a place must have."""


@dataclass(frozen=True, eq=False)
class Upright:
    """in_world, in_block: (3,) unit, upward on the mesh and in the photos."""

    in_world: Doubles
    in_block: Doubles

    @classmethod
    def of(
        cls, block: Reconstruction, up: ArrayLike, measured: Mapping[str, Sequence[float]]
    ) -> Upright:
        """By the photos of a block and what is up on the mesh, (3,) world. measured: by photo, what
        was upward in the axes of its camera, where that has measured it.
        """
        told = np.asarray(up, np.float64)
        known = [measured.get(name, ()) for name in block.names]
        return cls(told / np.linalg.norm(told), upward(block.cameras, known))

    def holds(self, R: Doubles) -> Bools:
        """(...,) whether blocks that are turned by (..., 3, 3) `R` into the world are upright."""
        there = np.einsum("...ij,j,i->...", R, self.in_block, self.in_world)
        found: Bools = there > np.cos(np.radians(LEVEL_DEG))
        return found
