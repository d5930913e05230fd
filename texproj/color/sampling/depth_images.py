"""Depth images of all cameras, made once and kept on disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.sampling.prepare import depth_seen
from texproj.render import Scene
from texproj.resources.scratch import Scratch


@dataclass(frozen=True)
class _Stored:
    camera: Camera
    start: int
    shape: tuple[int, int]


@dataclass(frozen=True, eq=False)
class DepthImages:
    """What each camera sees, so that the renderer is needed no longer.

    behind: the part of it that is the back of faces.
    """

    stored: tuple[_Stored, ...]
    scratch: Scratch
    behind: float = 0.0

    @classmethod
    def of(cls, cameras: Sequence[Camera], scene: Scene, scratch: Scratch) -> DepthImages:
        """Render all cameras' depth, reduced by `DEPTH_SCALE`, into `scratch`."""
        stored = []
        for camera in cameras:
            depth_camera, depth = depth_seen(camera, scene)
            start = scratch.append(np.ascontiguousarray(depth).data.cast("B"))
            stored.append(_Stored(depth_camera, start, (depth.shape[0], depth.shape[1])))
        return cls(tuple(stored), scratch)

    def read(self, number: int) -> tuple[Camera, Floats]:
        """The pinhole camera and the (h, w) depth image of a camera."""
        at = self.stored[number]
        data = self.scratch.read(at.start, 4 * at.shape[0] * at.shape[1])
        return at.camera, np.frombuffer(data, np.float32).reshape(at.shape)
