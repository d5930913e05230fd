"""All photos of a block adjusted together with those of them that hold it on the mesh."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.register.block.anchor import Anchor, Anchored
from texproj.register.block.bundle import bundled
from texproj.register.block.confirmation import Confirmation
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.said import Said, by_camera, by_picks, by_place, seen_on_mesh


@dataclass(frozen=True, eq=False)
class Held:
    """cameras: of the block's photos, world, full size; expected_error_px: (p,) one standard
    deviation of the surface in each; contradicts: names of the anchors that the others, the mesh
    and what the photos show contradict.
    """

    cameras: Sequence[Camera]
    expected_error_px: Doubles
    contradicts: tuple[str, ...]


def held_block(
    block: Reconstruction,
    place: Anchored,
    anchors: Sequence[Anchor],
    asked: Confirmation,
    calibrated: Collection[str] = (),
) -> Held:
    """The photos of `block`, which its `anchors` put at `place`.

    asked: what the photos say of that place; where they are sure of one near by, that counts as
    much as it is sure. calibrated: names of the photos whose lens is given.
    """
    cameras = [place.world_from_block.camera(camera) for camera in block.cameras]
    points = place.world_from_block.apply(block.points)
    before = Held(cameras, place.expected_error_px, place.contradicts)
    if asked.samples is None:
        return before
    seen = seen_on_mesh(block, points, asked.samples)
    believed = [one for one in anchors if one.name not in place.contradicts]
    said = [_by(anchor, seen[block.names.index(anchor.name)]) for anchor in believed]
    by_structure: list[Said] = []
    if asked.agrees and asked.sure is not None:
        there, percent = asked.cameras(block), asked.sure.expected_percent
        errors = [percent / 100 * max(c.width, c.height) for c in there.values()]
        by_structure = by_place(block, [*there.values()], errors, seen)
        if np.median(errors) < np.median(place.expected_error_px):
            cameras = [*there.values()]
            points = asked.sure.placed.world_from_block.apply(block.points)
    said = [one for one in said if len(one.px)]
    found = bundled(block, cameras, points, asked.samples, [*said, *by_structure], calibrated)
    if found is None:
        return before
    wrong = [
        one.name for one, bad in zip(said, found.contradicted[: len(said)], strict=True) if bad
    ]
    errors_px = found.expected_error_px
    if not by_structure and 2 * len(wrong) >= len(said):  # nothing tells which of them
        apart = np.array([found.apart_px[k] for k in range(len(said))])
        return Held(found.cameras, np.hypot(errors_px, np.median(apart)), place.contradicts)
    return Held(found.cameras, errors_px, (*place.contradicts, *wrong))


def _by(anchor: Anchor, seen: Doubles) -> Said:
    if anchor.picks is not None:
        picks = anchor.picks
        return by_picks(anchor.name, picks.xyz_in_world, picks.xy_px, anchor.pick_sigma_px)
    return by_camera(anchor.name, anchor.camera, anchor.expected_error_px, seen)
