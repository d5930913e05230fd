"""The way of the camera of a film around a model: all around it, or to and fro in front of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.report.pictures import Front, around
from texproj.stages.bench import Workbench

STEP_DEG = 15
LOOK_PX = 128
"""Size of the pictures that are looked at first."""

OPEN = 0.3
"""Part of a picture of the mesh that shows backs of faces, in the worst direction, from which on
the scan is open there: 0 all around a closed one, 1 behind a relief."""

FEW_BACKS = 0.05
"""Part that a film of an open scan may show."""

WIDEST_DEG = 60.0
"""Furthest to either side of an open scan: beyond, a relief is seen along its surface."""

LEAST_DEG = 15.0


@dataclass(frozen=True, eq=False)
class FilmPath:
    """angles_deg: (n,) of each frame, from the front about the upward axis; note: what is unusual
    about them, empty if nothing is; sided: whether the mesh's backs are known as such.
    """

    angles_deg: NDArray[np.float64]
    note: str = ""
    sided: bool = True


def film_path(bench: Workbench, front: Front, frames: int) -> FilmPath:
    """One turn about the model, or a swing where the scan is open: from its back a relief would be
    seen through. A mesh that shows backs from the front has its faces the wrong way round, and is
    turned about. Ours.
    """
    angles = list(range(-180, 180, STEP_DEG))
    backs = dict(zip(angles, _backs(bench, front, angles), strict=True))
    part = np.arange(frames) / frames
    if backs[0] > 1 / 2:
        return FilmPath(360 * part, sided=False)
    if max(backs.values()) < OPEN:
        return FilmPath(360 * part)
    low, high = (sign * _reach({sign * a: b for a, b in backs.items()}) for sign in (-1, 1))
    swing = (high - low) / 2 * np.sin(2 * np.pi * part) + (low + high) / 2
    told = f"{-low:.0f} and {high:.0f} degrees to its sides"
    note = f"the scan is open at its back, so the film swings {told} instead of turning about"
    return FilmPath(swing, note)


def _backs(bench: Workbench, front: Front, angles: Sequence[int]) -> list[float]:
    """Part of each picture of the mesh, turned by those angles, that shows backs of faces."""
    found = []
    for view in around(bench.mesh, front, angles, (LOOK_PX, LOOK_PX)):
        picture = bench.plain_scene.gbuffer(view, ("depth", "front"))
        solid = np.isfinite(picture.require("depth"))
        hidden = solid & ~picture.require("front")
        found.append(int(hidden.sum()) / max(int(solid.sum()), 1))
    return found


def _reach(backs: dict[int, float]) -> float:
    """How far the camera may go to one side, degrees."""
    far = 0
    while far < WIDEST_DEG and backs[far + STEP_DEG] <= FEW_BACKS:
        far += STEP_DEG
    return max(float(far), LEAST_DEG)
