"""How well places of a block agree with what its cameras see through: lines of sight must end on
the mesh, and meet nothing before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texproj.arrays import Bools
from texproj.register.block.cloud import Cloud
from texproj.register.block.hypotheses import Hypotheses
from texproj.register.block.scan import Scan

LINES = 400


class SightLines:
    """Casts lines of sight of a block against the mesh."""

    def __init__(self, cloud: Cloud, scan: Scan) -> None:
        self._end, self._eye = cloud.xyz[:LINES], cloud.eye[:LINES]
        self._caster = scan.caster

    def ranked(self, places: Hypotheses, within: float) -> Hypotheses:
        """Best first; the score is the share of lines that end on the mesh, give or take `within`
        sizes of the block, minus the share that is blocked on the way.
        """
        hit, blocked = self.outcome(places, within)
        return replace(places, score=hit.mean(axis=1) - blocked.mean(axis=1)).best(len(places))

    def outcome(self, places: Hypotheses, within: float) -> tuple[Bools, Bools]:
        """(h, n) whether each line ends on the mesh, and whether it is blocked before."""
        end, eye = places.apply(self._end), places.apply(self._eye)
        ray = end - eye
        hits = self._caster.first(eye.reshape(-1, 3), ray.reshape(-1, 3))
        length = np.linalg.norm(ray, axis=2)
        size = places.scale.astype(np.float32)[:, None]
        off = (hits.depth.reshape(length.shape) - 1) * length / size
        return np.abs(off) < within, off < -within
