"""Which way a scan stands and how large its unit is: what viewers need to show it upright."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera

Vector = NDArray[np.float64]

Measured = Sequence[float]

AXES: dict[str, tuple[float, float, float]] = {
    "x": (1, 0, 0), "-x": (-1, 0, 0), "y": (0, 1, 0), "-y": (0, -1, 0), "z": (0, 0, 1),
    "-z": (0, 0, -1),
}  # fmt: skip
"""Directions that a setting can name."""

METRES = {"auto": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001}
"""Metres in a unit of the scan; nothing tells the unit of a scan, so auto leaves it as it is."""

LEVEL_DEG = 20.0
"""Photos are held level within so much on the mean; a scan's axis that near is meant to be up."""

ONE_SIDED = 0.3
"""Where the photos' horizontal axes spread less in their second direction than this part of the
first, all look from one side: the axes say too little."""


@dataclass(frozen=True)
class Standing:
    """How a scan stands.

    up: unit vector in the scan's frame; metres: in a unit of the scan; reason: why, for people.
    """

    up: tuple[float, float, float]
    metres: float
    reason: str

    @property
    def as_is(self) -> bool:
        """Whether the scan stands as glTF has it: y upwards, in metres."""
        return self.up == AXES["y"] and self.metres == 1

    @property
    def rotation(self) -> tuple[float, float, float, float]:
        """Unit quaternion x, y, z, w of the shortest turn that takes `up` to y; half a turn goes
        about x, as from a camera's frame of OpenCV to one of OpenGL.
        """
        x, y, z = self.up
        if y < -1 + 1e-9:
            return 1.0, 0.0, 0.0, 0.0
        q = np.array([-z, 0.0, x, 1 + y])  # up x (0, 1, 0), 1 + up . (0, 1, 0)
        a, b, c, d = (float(v) for v in q / np.linalg.norm(q))
        return a, b, c, d


def standing(
    up: str, unit: str, cameras: Sequence[Camera], measured: Sequence[Measured] = ()
) -> Standing:
    """How the scan stands by the settings `up` (`AXES`, or auto) and `unit` (`METRES`). measured:
    as `upward` takes it.

    auto: what the photos' cameras say; an axis of the scan where one is near, since scans are
    levelled and photographers are not.
    """
    if up != "auto":
        return Standing(AXES[up], METRES[unit], f"up is {up}, by the settings")
    found = upward(cameras, measured)
    name, axis = max(AXES.items(), key=lambda item: float(found @ item[1]))
    count = f"{len(cameras)} photo{'s' * (len(cameras) != 1)}"
    if found @ axis > np.cos(np.radians(LEVEL_DEG)):
        return Standing(axis, METRES[unit], f"up is {name}, the axis that is upward in {count}")
    x, y, z = (float(v) for v in found)
    told = f"({x:.2f}, {y:.2f}, {z:.2f})"
    reason = f"up is {told}, which is upward in {count} and no axis of the scan"
    return Standing((x, y, z), METRES[unit], reason)


def upward(cameras: Sequence[Camera], measured: Sequence[Measured] = ()) -> Vector:
    """(3,) unit, upward in the world: what the cameras have measured, else what is most at right
    angles to the photos' horizontal axes. z without cameras. measured: of each camera what was
    upward in its axes, empty where it has not measured; none at all where no camera has.
    """
    if not cameras:
        return np.array([0.0, 0, 1])
    told = [
        np.asarray(up) @ camera.pose.R
        for camera, up in zip(cameras, measured, strict=bool(measured)) if len(up)
    ]  # fmt: skip
    if told:
        return _unit(np.median(told, axis=0))
    ups = -np.mean([camera.pose.R[1] for camera in cameras], axis=0)
    if len(cameras) < 3:
        return _unit(ups)
    _, spread, axes = np.linalg.svd(np.array([camera.pose.R[0] for camera in cameras]))
    if spread[1] < ONE_SIDED * spread[0]:
        return _unit(ups)
    return axes[2] * np.sign(axes[2] @ ups)


def _unit(vector: Vector) -> Vector:
    return vector / max(float(np.linalg.norm(vector)), 1e-12)
