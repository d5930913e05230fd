"""What placing a block gave, and how sure it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.register.block.similarity import Similarity


@dataclass(frozen=True, eq=False)
class Candidate:
    """One of several places between which the photos do not decide: where the block is there, its
    cameras (by name, of the world, full size), and its numbers, as in `BlockFit`.
    """

    world_from_block: Similarity
    cameras: Mapping[str, Camera]
    support: float
    expected_error_percent: float


@dataclass(frozen=True, eq=False)
class BlockFit:
    """world_from_block: where the block was put; sigma: (7,) standard deviations of its rotation
    about `pivot` (3,) world (rad, world axes), of the pivot's place (mesh units), and of the
    logarithm of its scale; focal_factor: by which all focal lengths were multiplied.

    cameras: by name, of the world, full size. expected_error_percent: one standard deviation of
    the surface's image, percent of the width, by `sigma`. support: mean share of patches of the
    mesh's structure that the photos show in place; rival: the same at the best place elsewhere;
    mirror_t: Student's t of the photos against their mirror images, positive where they are the
    right way round, 0 where the place is refused for another reason. accepted: the verdict;
    reason: one sentence with the next step where it is refused, or what to mind; candidates: the
    places among which somebody has to choose, the best first, where that is why it is refused;
    quality: further numbers for the report.
    """

    world_from_block: Similarity
    sigma: Doubles
    pivot: Doubles
    focal_factor: float
    cameras: Mapping[str, Camera]
    expected_error_percent: float
    support: float
    rival: float
    mirror_t: float
    accepted: bool
    reason: str
    candidates: tuple[Candidate, ...] = ()
    quality: dict[str, Any] = field(default_factory=dict)
