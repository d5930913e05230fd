"""The room in which an object was turned: its axes in each photo, told by the cameras alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.appearance.harmonics import BASES, basis
from texproj.appearance.sun import spiral
from texproj.arrays import Doubles
from texproj.camera import Camera

LEAST_TURN = 0.08
"""Least mean square of the cameras' right axes across their main direction: a round trip has 0.5,
photos over 60 degrees have 0.08. With less the light has hardly moved over the object.
"""

MOST_TILT = 0.05
"""Most mean square of the cameras' right axes along the axis: held level within 13 degrees."""

SAMPLED = 256
"""Directions by which a turn of the harmonics is found: they are nine polynomials, so that any
number above nine is exact."""


@dataclass(frozen=True, eq=False)
class Room:
    """Of p photos.

    room_from_world: (p, 3, 3) turns into the axes of the room: x to the camera's right, z along
    the axis of the table, upwards; harmonics: (p, 9, 9) matrices M such that ``basis(d @ R.T) =
    basis(d) @ M``.
    """

    room_from_world: Doubles
    harmonics: Doubles

    @classmethod
    def of(cls, cameras: Sequence[Camera]) -> Room | None:
        """None where the cameras do not go around an axis, held level."""
        turns = room_turns(cameras)
        if turns is None:
            return None
        sampled = spiral(SAMPLED)
        inverse = np.linalg.pinv(basis(sampled))
        matrices = np.stack([inverse @ basis(sampled @ turn.T) for turn in turns])
        assert matrices.shape[1:] == (BASES, BASES)
        return cls(turns, matrices)


def room_turns(cameras: Sequence[Camera]) -> Doubles | None:
    """(p, 3, 3) room from world; None where no axis is told.

    The axis is what all cameras' right axes are square to. A tripod that is moved up or down
    between two rounds leaves the room as it is.
    """
    right = np.stack([camera.pose.R[0] for camera in cameras])
    up = -np.stack([camera.pose.R[1] for camera in cameras]).mean(axis=0)
    spread, axes = np.linalg.eigh(right.T @ right / len(right))
    if len(cameras) < 3 or spread[1] < LEAST_TURN or spread[0] > MOST_TILT:
        return None
    axis = axes[:, 0] * (1 if axes[:, 0] @ up >= 0 else -1)
    level = right - np.outer(right @ axis, axis)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    upward = np.broadcast_to(axis, level.shape)
    return np.stack([level, np.cross(upward, level), upward], axis=1)
