"""A block of photos put onto the mesh without any start: geometry proposes, the photos decide."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.register.block.block_fit import BlockFit
from texproj.register.block.certainty import certainty
from texproj.register.block.cloud import LEAST_POINTS, Cloud
from texproj.register.block.decide import (
    LEAST_LEAD,
    LEAST_SUPPORT,
    SURE_SUPPORT,
    Judged,
    judged,
    same_place,
)
from texproj.register.block.mirror_test import MirrorTest, mirror_test
from texproj.register.block.propose import SCALE_BATCHES, Place, Proposer
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.scan import Scan
from texproj.register.block.witnesses import LoadPhoto, Witness, called
from texproj.render import Render

Told = Callable[[str, float], None]
"""``told(what, share)``: what is being done and the share of all that is done, 0 .. 1; whoever
listens may raise to stop the work."""

ASKED, ASKED_AT_LAST = 4, 8
"""Photos that are asked about every place, and about the best."""
TRIED = 5
"""Places of a batch of scales that the photos are asked about, at most."""
NEARBY = 0.2
"""Mean distance of the points, sizes of the block, from which the photos still lead home."""
WORTH_TRYING = 0.3
"""... and only those whose lines of sight are at least so good, relative to the best known."""


def place_block(
    block: Reconstruction,
    mesh: Mesh,
    render: Render,
    load_photo: LoadPhoto,
    told: Told = lambda what, share: None,
    seed: int = 0,
) -> BlockFit:
    """Where on `mesh` the photos of `block` belong, and whether to believe it.

    render: depth, normal, ambient occlusion and front of the mesh for a camera; load_photo: a
    photo by name, reduced to about 1024 pixels. The same seed gives the same result. Raises
    RegistrationError where there is nothing to compare.
    """
    told("comparing the photos' points with the mesh", 0.0)
    cloud = Cloud.of(block, seed)
    if len(cloud) < LEAST_POINTS:
        raise RegistrationError(
            f"the photos have only {len(cloud)} points in common, too few to see the mesh's shape "
            "in (pick 4 points in one of them)"
        )
    scan = Scan.of(mesh, seed)
    witnesses, broken = called(block, load_photo, render, scan.surface, ASKED_AT_LAST)
    if not witnesses:
        raise RegistrationError(next(iter(broken.values()), "the block has no photos"))
    search = _Search(Proposer(cloud, scan, seed), witnesses[:ASKED], told)
    return _concluded(search.run(), search, block, witnesses, broken)


@dataclass(frozen=True, eq=False)
class _Search:
    """Batches of scales in turn, until the photos are sure of a place."""

    proposer: Proposer
    witnesses: tuple[Witness, ...]
    told: Told

    def run(self) -> list[Judged]:
        """All places that the photos were asked about, the best first."""
        found: list[Judged] = []
        for k, scales in enumerate(SCALE_BATCHES):
            share = k / len(SCALE_BATCHES)
            self.told("comparing the photos' points with the mesh", share)
            places = self.proposer.places(scales)
            self.told("asking the photos", share)
            self._ask(self._worth_asking(places, found), found)
            if found and _best(found).support >= SURE_SUPPORT:
                break
        return sorted(found, key=lambda j: -j.support)

    def _ask(self, places: list[Place], found: list[Judged]) -> None:
        """Adds to `found`, until the photos are sure of one place and another was tried."""
        for place in places:
            if not self._near_the_sure(place, found):
                found.append(judged(self.witnesses, place))
            if self._decided(found):
                return

    def _near_the_sure(self, place: Place, found: list[Judged]) -> bool:
        """Nothing new is to be learnt of a place from which the photos would lead to the best."""
        if not found or _best(found).support < SURE_SUPPORT:
            return False
        return self.proposer.gap(place, _best(found).place) < NEARBY

    def _worth_asking(self, places: list[Place], found: list[Judged]) -> list[Place]:
        """The likely ones, and in any case one that is elsewhere."""
        sights = [p.sight for p in places] + [j.place.sight for j in found]
        least = WORTH_TRYING * max(sights, default=0.0)
        likely = [p for p in places if p.sight >= least > 0][:TRIED]
        if not likely:
            return []
        elsewhere = [p for p in places if self.proposer.gap(p, likely[0]) >= NEARBY][:1]
        return likely + [p for p in elsewhere if p not in likely]

    def _decided(self, found: list[Judged]) -> bool:
        """The photos are sure of one place, and another was tried."""
        if not found:
            return False
        best = _best(found)
        if best.support < SURE_SUPPORT:
            return False
        return any(not same_place(self.witnesses, best, other) for other in found)


def _best(found: list[Judged]) -> Judged:
    return max(found, key=lambda j: j.support)


def _concluded(
    found: list[Judged],
    search: _Search,
    block: Reconstruction,
    witnesses: tuple[Witness, ...],
    broken: dict[str, str],
) -> BlockFit:
    if not found:
        raise RegistrationError(
            "the points that the photos have in common fit nowhere on the mesh "
            "(is it the same object? else pick 4 points in one photo)"
        )
    best = found[0]
    elsewhere = [j for j in found[1:] if not same_place(search.witnesses, best, j)]
    rival = max((j.support for j in elsewhere), default=0.0)
    search.told("looking at details", 0.7)
    proposer = search.proposer
    sure = certainty(witnesses, best, proposer.cloud, proposer.scan.samples)
    reason = _refusal(sure.support, rival)
    mirror = MirrorTest(0.0)
    if not reason:
        search.told("comparing with the mirror image", 0.8)
        mirror = mirror_test(proposer, witnesses, ASKED, best)
    return BlockFit(
        world_from_block=sure.placed.world_from_block,
        sigma=sure.sigma,
        pivot=best.place.pivot,
        focal_factor=float(np.exp(sure.placed.log_focal)),
        cameras=sure.placed.cameras(dict(zip(block.names, block.cameras, strict=True))),
        expected_error_percent=sure.expected_percent,
        support=sure.support,
        rival=rival,
        mirror_t=mirror.t,
        accepted=not reason and not mirror.refused,
        reason=reason or _mirror_reason(mirror),
        quality={
            "sight": best.place.sight,
            "rival_sight": max((j.place.sight for j in elsewhere), default=0.0),
            "places_tried": len(found),
            "structure_percent": sure.structure_percent,
            "photos_asked": [w.name for w in witnesses],
            "photos_unreadable": broken,
        },
    )


def _refusal(support: float, rival: float) -> str:
    """Why a place is not to be believed; empty if it is."""
    if support < LEAST_SUPPORT:
        return (
            f"only {support:.0%} of the mesh's structure is found in the photos at the best place "
            "(is it the same object? else pick 4 points in one photo)"
        )
    if support < LEAST_LEAD * rival:
        return (
            f"the photos fit the mesh in two places nearly as well ({support:.0%} and {rival:.0%} "
            "of its structure; pick 4 points in one photo)"
        )
    return ""


def _mirror_reason(mirror: MirrorTest) -> str:
    if mirror.refused:
        return (
            "the photos fit better with left and right exchanged (is it a mirrored scan? mirror "
            "the mesh, or pick 4 points)"
        )
    if mirror.undecided:
        return (
            "the photos do not tell the mesh from its mirror image (look whether writing or "
            "damage are on the right side)"
        )
    return ""
