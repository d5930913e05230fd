"""What placing a block says of each of its photos."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera
from texproj.photo import Photo
from texproj.records import THROUGH, Fit
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.similarity import Similarity
from texproj.register.block.structure_from_motion import LONGEST_PX
from texproj.render import GBuffer
from texproj.stages.bench import Workbench

STAGE = "block"
STEPS = 100
"""Parts of the progress while the block is put onto the mesh."""
MAX_ERROR_PERCENT = 0.5
"""Expected error, percent of the longer side, beyond which a photo held by others is refused."""
CELLS = 6
"""Along each side of a picture, for telling how much of it the block's points cover."""
SHOWN_POINTS = 300
"""Points of a block that are kept to be shown, about."""
CHANNELS = ("depth", "normal", "ao", "front")

Point = tuple[float, float, float]
Told = dict[str, Fit | str]
"""For each photo a fit, or why there is none."""


def load_reduced(bench: Workbench, name: str, longest: int) -> Photo:
    """A photo, its longer side reduced to `longest`."""
    return bench.project.load_photo(name, longest)


def rendered(bench: Workbench, camera: Camera) -> GBuffer:
    """The mesh as blocks are compared with it."""
    return bench.light_scene.gbuffer(camera, CHANNELS)


def sparse_points(points: Doubles, world_from_block: Similarity) -> list[Point]:
    """Some of the points (n, 3) of a block, world, for showing where it is."""
    some = points[:: max(1, len(points) // SHOWN_POINTS)]
    placed = world_from_block.apply(some)
    return [(_short(x), _short(y), _short(z)) for x, y, z in placed]


def _short(value: float) -> float:
    return float(f"{value:.6g}")


def fit_of(
    camera: Camera, part: Reconstruction, row: int, error_px: float, quality: Mapping[str, Any]
) -> Fit:
    """What a block says of one of its photos."""
    points, xy = part.seen_from(row)
    return Fit(
        camera=camera,
        method="block",
        expected_error_px=error_px,
        residual_px=part.error_px[points] * max(1.0, max(camera.width, camera.height) / LONGEST_PX),
        inliers=np.ones(len(points), bool),
        covariance=np.full((6, 6), np.nan),
        quality={**quality, "block_points": len(points), "block_cover": _cover(camera, xy)},
    )


def _cover(camera: Camera, xy: Floats) -> float:
    """Share of the picture's cells in which the photo shows a point of its block."""
    cell = np.floor(CELLS * xy / (camera.width, camera.height)).astype(int).clip(0, CELLS - 1)
    return round(len(np.unique(cell, axis=0)) / CELLS**2, 2)


def certain(fit: Fit) -> Fit:
    """The fit, not accepted where the anchors leave it too uncertain."""
    percent = 100 * fit.expected_error_px / max(fit.camera.width, fit.camera.height)
    if percent <= MAX_ERROR_PERCENT:
        return fit
    through = ", ".join(fit.quality[THROUGH])
    reason = f"{through} leaves it uncertain by {percent:.2f} % of its longer side; pick 8 points"
    return replace(fit, accepted=False, reason=reason)
