"""A block of photos put onto the mesh without any start: geometry proposes, the photos decide."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from texproj.arrays import Doubles
from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.register.block.adjusting import Asked, adjusted
from texproj.register.block.block_fit import BlockFit
from texproj.register.block.candidates import candidates
from texproj.register.block.certainty import certainty
from texproj.register.block.cloud import LEAST_POINTS, Cloud
from texproj.register.block.decide import Judged, same_place
from texproj.register.block.mirror_test import MirrorTest, mirror_test
from texproj.register.block.placed_block import PlacedBlock
from texproj.register.block.propose import proposers
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.scan import Scan
from texproj.register.block.search import NOBODY, Listener, Search
from texproj.register.block.slides import slides, untold
from texproj.register.block.upright import Upright
from texproj.register.block.verdict import doubt, refusal, slippery, torn
from texproj.register.block.witnesses import LoadPhoto, Witness, called
from texproj.render import Render

ASKED, ASKED_AT_LAST = 4, 8
"""Photos that are asked about every place, and about the best."""


@dataclass(frozen=True, eq=False)
class Beforehand:
    """What is known before a block is placed. calibrated: names of the photos whose lens was given;
    up: (3,) which way is up on the mesh, world, None where nobody said; up_in_cam: by name, (3,)
    unit, what was upward in the axes of a photo's camera, empty where that has not measured it.
    """

    calibrated: Collection[str] = ()
    up: Doubles | None = None
    up_in_cam: Mapping[str, Sequence[float]] = field(default_factory=dict)


NOTHING = Beforehand()


def place_block(
    block: Reconstruction,
    mesh: Mesh,
    render: Render,
    load_photo: LoadPhoto,
    listener: Listener = NOBODY,
    known: Beforehand = NOTHING,
    seed: int = 0,
) -> BlockFit:
    """Where on `mesh` the photos of `block` belong, and whether to believe it.

    render: depth, normal, ambient occlusion and front of the mesh, or of its `light_mesh`, for a
    camera; load_photo: a photo by name, reduced to about 1024 pixels; listener: is told how far the
    search is, and the best place so far. The same seed gives the same result. Raises
    RegistrationError where there is nothing to compare.
    """
    listener.told("comparing the photos' points with the mesh", 0.0)
    cloud = Cloud.of(block, seed)
    if len(cloud) < LEAST_POINTS:
        raise RegistrationError(
            f"the photos have only {len(cloud)} points in common, too few to see the mesh's shape "
            "in (pick 8 points in one of them)"
        )
    scan = Scan.of(mesh, seed)
    witnesses, broken = called(block, load_photo, render, scan.surface, ASKED_AT_LAST)
    if not witnesses:
        raise RegistrationError(next(iter(broken.values()), "the block has no photos"))
    upright = None if known.up is None else Upright.of(block, known.up, known.up_in_cam)
    places = proposers(block, mesh, cloud, scan, seed, upright)
    search = Search(places, witnesses[:ASKED], listener, upright)
    return _concluded(search.run(), search, Asked(block, witnesses, broken, known.calibrated))


def _concluded(found: list[Judged], search: Search, asked: Asked) -> BlockFit:
    if not found or not found[0].seen:
        raise RegistrationError(
            "the points that the photos have in common fit nowhere on the mesh "
            "(is it the same object? else pick 8 points in one photo)"
        )
    best, witnesses = found[0], asked.witnesses
    elsewhere = [j for j in found[1:] if not same_place(search.witnesses, best, j)]
    rival = max((search.rivalry(best, j) for j in elsewhere), default=0.0)
    rivals = [j for j in elsewhere if torn(best.support, search.rivalry(best, j))]
    search.listener.told("looking at details", 0.7)
    sure = certainty(witnesses, best)
    slippery_mesh = _slides_away(best, sure.placed, witnesses)
    reason = slippery_mesh or refusal(sure.support, rival)
    mirror = MirrorTest(0.0)
    if not reason:
        search.listener.told("comparing with the mirror image", 0.8)
        mirror = mirror_test(witnesses, ASKED, best)
    place = adjusted(asked, best, sure)
    return BlockFit(
        world_from_block=sure.placed.world_from_block,
        sigma=sure.sigma,
        pivot=best.place.pivot,
        cameras=place.cameras,
        expected_error_px=place.expected_error_px,
        support=sure.support,
        rival=rival,
        mirror_t=mirror.t,
        accepted=not reason and not mirror.refused,
        reason=reason or doubt(mirror),
        candidates=() if slippery_mesh else candidates(asked, place, rivals),
        quality={
            "sight": best.place.sight,
            "rival_sight": max((j.place.sight for j in elsewhere), default=0.0),
            "places_tried": len(found),
            "structure_percent": sure.structure_percent,
            "photos_asked": [w.name for w in witnesses],
            "photos_unreadable": asked.broken,
        },
    )


def _slides_away(best: Judged, placed: PlacedBlock, witnesses: tuple[Witness, ...]) -> str:
    """Why the place is not to be believed, where the mesh slides along itself and its edges do not
    tell how far; empty if they do.
    """
    samples = best.place.proposer.scan.samples
    xyz = samples.world_from_unit.apply(samples.xyz)
    asked = witnesses[:ASKED]
    left = untold(
        [placed.camera(w.in_block) for w in asked],
        [w.photo for w in asked],
        asked[0].render,
        slides(xyz, samples.normal.astype(np.float64)),
    )
    return slippery(left[0].words) if left else ""
