"""What placing a block gave, and how sure it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.register.block.similarity import Similarity


@dataclass(frozen=True, eq=False)
class Candidate:
    """A place of a block: where it was put, its cameras after they were adjusted, and the numbers
    that `BlockFit` has of it.
    """

    world_from_block: Similarity
    cameras: Mapping[str, Camera]
    expected_error_px: Mapping[str, float]
    support: float


@dataclass(frozen=True, eq=False)
class BlockFit:
    """world_from_block: where the block was put; sigma: (7,) standard deviations of its rotation
    about `pivot` (3,) world (rad, world axes), of the pivot's place (mesh units), and of the
    logarithm of its scale, before the photos were adjusted one by one.

    cameras: by name, of the world, full size, adjusted. expected_error_px: of each, one standard
    deviation of the surface's image. support: mean share of patches of the
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
    cameras: Mapping[str, Camera]
    expected_error_px: Mapping[str, float]
    support: float
    rival: float
    mirror_t: float
    accepted: bool
    reason: str
    candidates: tuple[Candidate, ...] = ()
    quality: dict[str, Any] = field(default_factory=dict)

    @property
    def expected_error_percent(self) -> float:
        """Median over the photos, percent of the longer side."""
        side = {name: max(camera.width, camera.height) for name, camera in self.cameras.items()}
        return float(np.median([100 * px / side[k] for k, px in self.expected_error_px.items()]))
