"""Many places of a block on the mesh at once, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bools, Doubles, Floats
from texproj.register.block.rotations import exponentials
from texproj.register.block.similarity import Similarity


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """h similarities from the block's unit frame to the mesh's, and how good each is.

    R: (h, 3, 3); scale: (h,); t: (h, 3); score: (h,), higher is better.
    """

    R: Doubles
    scale: Doubles
    t: Doubles
    score: Doubles

    def __len__(self) -> int:
        return len(self.scale)

    def __getitem__(self, which: NDArray[np.integer] | Bools | slice) -> Hypotheses:
        return Hypotheses(self.R[which], self.scale[which], self.t[which], self.score[which])

    def similarity(self, i: int) -> Similarity:
        return Similarity(float(self.scale[i]), self.R[i], self.t[i])

    def apply(self, xyz: NDArray[np.floating]) -> Floats:
        """(h, n, 3) where each puts (n, 3) points of the block."""
        turns = (self.scale[:, None, None] * self.R).transpose(0, 2, 1).astype(np.float32)
        return xyz.astype(np.float32) @ turns + self.t[:, None].astype(np.float32)

    def best(self, count: int) -> Hypotheses:
        """The `count` best, best first."""
        return self[np.argsort(-self.score, kind="stable")[:count]]

    def distinct(self, xyz: NDArray[np.floating], apart: float) -> Hypotheses:
        """Best first, without those that put the points on average closer than `apart`, relative
        to the scale, to where a better one puts them.
        """
        ranked = self.best(len(self))
        placed = ranked.apply(xyz)
        kept: list[int] = []
        for i in range(len(ranked)):
            gap = np.linalg.norm(placed[kept] - placed[i], axis=2).mean(axis=1)
            if not (gap < apart * ranked.scale[i]).any():
                kept.append(i)
        return ranked[np.array(kept, int)]

    def shaken(self, copies: int, deviations: tuple[float, float, float], seed: int) -> Hypotheses:
        """So many disturbed copies of each. deviations: of the turn about the block's middle (rad),
        the shift (sizes of the block), the logarithm of the scale.
        """
        rng = np.random.default_rng(seed)
        each = self[np.repeat(np.arange(len(self)), copies)]
        turn, shift, log = deviations
        scale = each.scale * np.exp(log * rng.standard_normal(len(each)))
        turns = exponentials(turn * rng.standard_normal((len(each), 3)))
        t = each.t + shift * scale[:, None] * rng.standard_normal((len(each), 3))
        return Hypotheses(turns @ each.R, scale, t, each.score)

    @staticmethod
    def joined(parts: Sequence[Hypotheses]) -> Hypotheses:
        return Hypotheses(
            np.concatenate([p.R for p in parts]),
            np.concatenate([p.scale for p in parts]),
            np.concatenate([p.t for p in parts]),
            np.concatenate([p.score for p in parts]),
        )
