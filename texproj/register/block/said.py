"""What is said of single photos of a block, in one form: points of the surface, and the pixels at
which the photo shows them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.scan_samples import ScanSamples

OF_A_CAMERA = 24
"""Points that stand for a camera: enough to be spread over its picture."""
STRUCTURE_SHARE = 0.4
"""A place by the mesh's structure is less far off than what it counts by, so that the points on
the mesh lead, which know no light: of two scenes, with whole, cut and noisy meshes."""
NEARBY = 0.02
"""Distance, sizes of the mesh, within which a point of the block lies on it."""


@dataclass(frozen=True, eq=False)
class Said:
    """(n, 3) points `xyz`, world, are seen at (n, 2) pixels `px` of the full-size photo `name`,
    give or take `sigma_px` across and down. counts: for how many independent sightings all of them
    together count: n for picks; for a camera, whose errors all its points share, half the number of
    what is unknown of it, since then its expected error comes out again.
    """

    name: str
    xyz: Doubles
    px: Doubles
    sigma_px: float
    counts: float
    share: float = 1.0


def by_picks(name: str, xyz: Doubles, px: Doubles, sigma_px: float) -> Said:
    """Picked points, each with its own noise."""
    return Said(name, xyz, px, sigma_px, float(len(px)))


def by_camera(name: str, camera: Camera, error_px: float, xyz: Doubles) -> Said:
    """A camera that is expected to be off by so much (the length); xyz: (n, 3) what it sees."""
    few = xyz[:: max(1, len(xyz) // OF_A_CAMERA)]
    px, _ = camera.project(few)
    seen = camera.inside(px)
    return Said(name, few[seen], px[seen], error_px / np.sqrt(2), 6 / 2)


def by_place(
    block: Reconstruction, cameras: Sequence[Camera], error_px: Sequence[float],
    seen: Sequence[Doubles],
) -> list[Said]:  # fmt: skip
    """All cameras of a block that were put there as one, by seven numbers.

    error_px: expected of each, shared by all; seen: of each (n, 3) points.
    """
    shared = np.sqrt(len(cameras))
    return [
        Said(name, one.xyz, one.px, shared * one.sigma_px, 7 / 2, STRUCTURE_SHARE)
        for name, one in zip(
            block.names, map(by_camera, block.names, cameras, error_px, seen), strict=True
        )
    ]


def seen_on_mesh(block: Reconstruction, points: Doubles, samples: ScanSamples) -> list[Doubles]:
    """Of each photo the (n, 3) points that it saw and that lie on the mesh. points: the block's,
    world.
    """
    distance, _ = samples.tree.query(
        samples.world_from_unit.inverse.apply(points), distance_upper_bound=NEARBY
    )
    near = np.isfinite(distance)
    rows = [block.seen_from(k)[0] for k in range(len(block.names))]
    return [points[own[near[own]]] for own in rows]
