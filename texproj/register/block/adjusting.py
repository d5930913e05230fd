"""A block at a place, its photos adjusted one by one."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from texproj.register.block.block_fit import Candidate
from texproj.register.block.bundle import bundled
from texproj.register.block.certainty import Certainty
from texproj.register.block.decide import Judged
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.said import by_place, seen_on_mesh
from texproj.register.block.witnesses import Witness


@dataclass(frozen=True, eq=False)
class Asked:
    """A block and its photos: those that are asked, why others cannot be, whose lens is given."""

    block: Reconstruction
    witnesses: tuple[Witness, ...]
    broken: dict[str, str]
    calibrated: Collection[str]


def adjusted(asked: Asked, at: Judged, sure: Certainty) -> Candidate:
    """The cameras at a place with the block's points on the mesh, and their expected errors."""
    block, samples = asked.block, at.place.proposer.scan.samples
    cameras = [sure.placed.camera(camera) for camera in block.cameras]
    errors_px = [sure.expected_percent / 100 * max(c.width, c.height) for c in cameras]
    points = sure.placed.world_from_block.apply(block.points)
    said = by_place(block, cameras, errors_px, seen_on_mesh(block, points, samples))
    found = bundled(block, cameras, points, samples, said, asked.calibrated)
    if found is not None:
        cameras, errors_px = [*found.cameras], [float(error) for error in found.expected_error_px]
    return Candidate(
        sure.placed.world_from_block,
        dict(zip(block.names, cameras, strict=True)),
        dict(zip(block.names, errors_px, strict=True)),
        sure.support,
    )
