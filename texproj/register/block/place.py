"""A block of photos put onto the mesh without any start: geometry proposes, the photos decide."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.register.block.block_fit import BlockFit
from texproj.register.block.bundle import bundled
from texproj.register.block.certainty import Certainty, certainty
from texproj.register.block.cloud import LEAST_POINTS, Cloud
from texproj.register.block.decide import Judged, same_place
from texproj.register.block.mirror_test import MirrorTest, mirror_test
from texproj.register.block.placed_block import PlacedBlock
from texproj.register.block.propose import proposers
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.said import by_place, seen_on_mesh
from texproj.register.block.scan import Scan
from texproj.register.block.search import Search, Told
from texproj.register.block.slides import slides, untold
from texproj.register.block.upright import Upright
from texproj.register.block.verdict import doubt, refusal, slippery
from texproj.register.block.witnesses import LoadPhoto, Witness, called
from texproj.render import Render

ASKED, ASKED_AT_LAST = 4, 8
"""Photos that are asked about every place, and about the best."""


@dataclass(frozen=True, eq=False)
class Beforehand:
    """What is known before a block is placed. calibrated: names of the photos whose lens was given;
    up: (3,) which way is up on the mesh, world, None where nobody said.
    """

    calibrated: Collection[str] = ()
    up: Doubles | None = None


def place_block(
    block: Reconstruction,
    mesh: Mesh,
    render: Render,
    load_photo: LoadPhoto,
    told: Told = lambda what, share: None,
    known: Beforehand = Beforehand(),
    seed: int = 0,
) -> BlockFit:
    """Where on `mesh` the photos of `block` belong, and whether to believe it.

    render: depth, normal, ambient occlusion and front of the mesh, or of its `light_mesh`, for a
    camera; load_photo: a photo by name, reduced to about 1024 pixels. The same seed gives the same
    result. Raises RegistrationError where there is nothing to compare.
    """
    told("comparing the photos' points with the mesh", 0.0)
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
    upright = None if known.up is None else Upright.of(block, known.up)
    places = proposers(block, mesh, cloud, scan, seed, upright)
    search = Search(places, witnesses[:ASKED], told, upright)
    return _concluded(search.run(), search, _Asked(block, witnesses, broken, known.calibrated))


@dataclass(frozen=True, eq=False)
class _Asked:
    """A block and its photos: those that are asked, why others cannot be, whose lens is given."""

    block: Reconstruction
    witnesses: tuple[Witness, ...]
    broken: dict[str, str]
    calibrated: Collection[str]


def _concluded(found: list[Judged], search: Search, asked: _Asked) -> BlockFit:
    if not found or not found[0].seen:
        raise RegistrationError(
            "the points that the photos have in common fit nowhere on the mesh "
            "(is it the same object? else pick 8 points in one photo)"
        )
    best, witnesses = found[0], asked.witnesses
    elsewhere = [j for j in found[1:] if not same_place(search.witnesses, best, j)]
    rival = max((search.rivalry(best, j) for j in elsewhere), default=0.0)
    search.told("looking at details", 0.7)
    sure = certainty(witnesses, best)
    reason = _slides_away(best, sure.placed, witnesses) or refusal(sure.support, rival)
    mirror = MirrorTest(0.0)
    if not reason:
        search.told("comparing with the mirror image", 0.8)
        mirror = mirror_test(witnesses, ASKED, best)
    cameras, errors_px = _adjusted(asked, best, sure)
    return BlockFit(
        world_from_block=sure.placed.world_from_block,
        sigma=sure.sigma,
        pivot=best.place.pivot,
        cameras=dict(zip(asked.block.names, cameras, strict=True)),
        expected_error_px=dict(zip(asked.block.names, errors_px, strict=True)),
        support=sure.support,
        rival=rival,
        mirror_t=mirror.t,
        accepted=not reason and not mirror.refused,
        reason=reason or doubt(mirror),
        quality={
            "sight": best.place.sight,
            "rival_sight": max((j.place.sight for j in elsewhere), default=0.0),
            "places_tried": len(found),
            "structure_percent": sure.structure_percent,
            "photos_asked": [w.name for w in witnesses],
            "photos_unreadable": asked.broken,
        },
    )


def _adjusted(
    asked: _Asked, best: Judged, sure: Certainty
) -> tuple[Sequence[Camera], Sequence[float]]:
    """The cameras with the block's points on the mesh, and their expected errors, pixels."""
    block, samples = asked.block, best.place.proposer.scan.samples
    cameras = [sure.placed.camera(camera) for camera in block.cameras]
    errors = [sure.expected_percent / 100 * max(c.width, c.height) for c in cameras]
    points = sure.placed.world_from_block.apply(block.points)
    said = by_place(block, cameras, errors, seen_on_mesh(block, points, samples))
    found = bundled(block, cameras, points, samples, said, asked.calibrated)
    if found is None:
        return cameras, errors
    return found.cameras, [float(error) for error in found.expected_error_px]


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
