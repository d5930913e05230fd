"""Which of the proposed places is right: asked of the photos.

From each place the whole block is moved so that the mesh's structure falls on the photos'; at
the right place most of it is found, elsewhere a few patches are, by chance. Method: ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.register.block.placed_block import Matched, PatchFit, PlacedBlock
from texproj.register.block.propose import Place
from texproj.register.block.witnesses import Witness
from texproj.register.motion import motion_px
from texproj.register.structure.solve import CHECK, NEAR, WIDE, found_share
from texproj.register.structure.view import PatchRule, StructureView
from texproj.solve.lm import LmFit, LmOptions, Loss, minimize

ROUNDS: tuple[tuple[PatchRule, tuple[float, ...]], ...] = (
    (WIDE, (6.0, 3.0)),
    (NEAR, (3.0, 1.5)),
    (NEAR, (2.0, 1.0)),
)
"""What is sought, and the scales of the loss, pixels of the middle level: wide once, near twice."""
STEPS = LmOptions(max_iterations=20, cost_tolerance=1e-4)
LEAST_MATCHES = 60
"""Matches in all photos together below which nothing is concluded."""
SAME_PLACE = 0.02
"""Image motion, as a share of the width, below which two places are the same."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A place after the photos moved it. support: mean share of patches found in place; seen:
    (n, 3) world points that each photo saw there, in the photos' order.
    """

    place: Place
    placed: PlacedBlock
    support: float
    seen: tuple[Doubles, ...]


def judged(witnesses: Sequence[Witness], place: Place) -> Judged:
    """The place to which the photos' structure leads from `place`."""
    placed = PlacedBlock(place.world_from_block)
    views = [w.view(placed.camera(w.in_block)) for w in witnesses]
    for rule, scales in ROUNDS:
        fit = matched_fit(witnesses, views, placed, rule, place)
        if fit.matches < LEAST_MATCHES:
            return Judged(place, placed, 0.0, ())
        placed = tightened(fit, placed, scales).x
    seen = tuple(photo.seen.xyz_in_world for photo in fit.photos)
    return Judged(place, placed, support_at(witnesses, views, placed), seen)


def support_at(
    witnesses: Sequence[Witness], views: Sequence[StructureView], placed: PlacedBlock
) -> float:
    """Mean share, over photos, of the patches that are found where `placed` says."""
    checks = [
        view.observe(placed.camera(w.in_block), CHECK)
        for w, view in zip(witnesses, views, strict=True)
    ]
    return float(np.mean([found_share(seen) for seen in checks]))


def matched_fit(
    witnesses: Sequence[Witness],
    views: Sequence[StructureView],
    placed: PlacedBlock,
    rule: PatchRule,
    place: Place,
) -> PatchFit:
    """The least-squares problem of the patches that are found from `placed`."""
    photos = [
        Matched(w.in_block, view, view.observe(placed.camera(w.in_block), rule))
        for w, view in zip(witnesses, views, strict=True)
    ]
    return PatchFit(photos, place.pivot, place.unit)


def tightened(fit: PatchFit, placed: PlacedBlock, scales: Sequence[float]) -> LmFit[PlacedBlock]:
    """The fit under a loss that narrows through `scales`, pixels."""
    for scale in scales:
        found = minimize(fit, placed, Loss("geman-mcclure", scale), STEPS)
        placed = found.x
    return found


def same_place(witnesses: Sequence[Witness], a: Judged, b: Judged) -> bool:
    """Whether two places show the surface at the same pixels."""
    gaps = [
        motion_px(a.placed.camera(w.in_block), b.placed.camera(w.in_block), xyz) / w.in_block.width
        for w, xyz in zip(witnesses, a.seen, strict=False)
        if len(xyz)
    ]
    return bool(gaps) and float(np.median(gaps)) < SAME_PLACE
