"""What the photos of a block say of the place at which its registered photos, the anchors, put it.

Whoever vouches for a photo may be wrong by far and claim a few pixels. So all photos are asked,
as they are of a place that was searched for: how much of the mesh's structure do they show there,
and where does it lead? Method: ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from texproj.camera import Camera
from texproj.mesh import Mesh
from texproj.register.block.anchor import Anchored
from texproj.register.block.certainty import Certainty, certainty
from texproj.register.block.cloud import Cloud
from texproj.register.block.decide import judged, support_at
from texproj.register.block.mirror_test import MirrorTest, mirror_test
from texproj.register.block.place import ASKED, ASKED_AT_LAST
from texproj.register.block.placed_block import PlacedBlock
from texproj.register.block.propose import Place, Proposer
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.scan import Scan
from texproj.register.block.scan_samples import ScanSamples
from texproj.register.block.search import SURE_SUPPORT
from texproj.register.block.similarity import Similarity
from texproj.register.block.verdict import LEAST_LEAD, LEAST_SUPPORT
from texproj.register.block.witnesses import LoadPhoto, Witness, called
from texproj.register.motion import motion_px
from texproj.render import Render

APART = 3.0
"""Standard deviations beyond which anchors and photos put the block at different places ..."""
LEAST_APART_PERCENT = 0.3
"""... and the distance, percent of the width, below which they never do."""
UNTESTED = MirrorTest(0.0)


@dataclass(frozen=True, eq=False)
class Confirmation:
    """support: mean share of patches that the photos show in place where the anchors put the block.
    sure: the place to which the mesh's structure leads from there, None where too little of it is
    found; apart_percent: how far apart the two show the surface, percent of the width, and
    apart_sigma: the same in standard deviations. mirror: the photos against their mirror images
    there, where they bear the anchors out: a scan that is mirrored agrees, too. samples: of the
    mesh, None where there was nothing to ask.
    """

    support: float
    sure: Certainty | None
    apart_percent: float
    apart_sigma: float
    mirror: MirrorTest = UNTESTED
    samples: ScanSamples | None = None

    @property
    def agrees(self) -> bool:
        """Whether the photos bear the anchors out."""
        near = self.apart_sigma < APART or self.apart_percent < LEAST_APART_PERCENT
        return self.sure is not None and near

    @property
    def contradicts(self) -> bool:
        """Whether the photos show the structure clearly, and clearly elsewhere."""
        if self.sure is None or self.agrees:
            return False
        return self.sure.support >= min(SURE_SUPPORT, LEAST_LEAD * self.support)

    def cameras(self, block: Reconstruction) -> Mapping[str, Camera]:
        """The block's photos where structure puts them, full size, of the world, by name."""
        assert self.sure is not None
        return self.sure.placed.cameras(dict(zip(block.names, block.cameras, strict=True)))


def confirmation(
    block: Reconstruction,
    held: Anchored,
    mesh: Mesh,
    render: Render,
    load_photo: LoadPhoto,
    seed: int = 0,
) -> Confirmation:
    """What the photos say of the place `held` of `block`.

    render, load_photo: as for `place_block`. The same seed gives the same result.
    """
    scan, cloud = Scan.of(mesh, seed), Cloud.of(block, seed)
    asked, _ = called(block, load_photo, render, scan.surface, ASKED_AT_LAST)
    witnesses = asked[:ASKED]
    if not witnesses or not len(cloud):
        return Confirmation(0.0, None, np.inf, np.inf)
    there = PlacedBlock(held.world_from_block)
    views = [w.view(there.camera(w.in_block)) for w in witnesses]
    support = support_at(witnesses, views, there)
    best = judged(witnesses, _place(held.world_from_block, Proposer(cloud, scan, seed)))
    if best.support < LEAST_SUPPORT:
        return Confirmation(support, None, np.inf, np.inf, samples=scan.samples)
    sure = certainty(witnesses, best)
    apart = _apart_percent(witnesses, there, sure.placed, best.seen)
    own = 100 * float(np.median(held.expected_error_px / [c.width for c in block.cameras]))
    sigmas = apart / float(np.hypot(own, sure.expected_percent))
    found = Confirmation(support, sure, apart, sigmas, samples=scan.samples)
    return replace(found, mirror=mirror_test(asked, ASKED, best)) if found.agrees else found


def _place(world_from_block: Similarity, proposer: Proposer) -> Place:
    unit = world_from_block @ proposer.cloud.block_from_unit
    return Place(world_from_block, 0.0, unit.t, unit.scale, proposer)


def _apart_percent(
    witnesses: tuple[Witness, ...], a: PlacedBlock, b: PlacedBlock, seen: tuple[np.ndarray, ...]
) -> float:
    """Median over photos of the distance between two places' images of what each photo saw."""
    apart = [
        100 * motion_px(a.camera(w.in_block), b.camera(w.in_block), xyz) / w.in_block.width
        for w, xyz in zip(witnesses, seen, strict=True) if len(xyz)
    ]  # fmt: skip
    return float(np.median(apart)) if apart else np.inf
