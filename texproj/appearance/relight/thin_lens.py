"""A lens with a pupil: what lies before and behind its focus is blurred, corners are darker."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from texproj.appearance.relight.illumination import Illumination
from texproj.appearance.relight.lit_surface import LitSurface
from texproj.appearance.relight.pictures import relit_pictures
from texproj.arrays import Floats
from texproj.camera import Camera, Pose
from texproj.render import Renderer

SENSOR_MM = 36.0
"""Longer side of the sensor that a number of the aperture is meant for: full frame."""

PLACES = 32
"""On the pupil: blur of 30 pixels has no steps."""

GOLDEN = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True)
class Lens:
    """radius: of the pupil; focus: distance along the axis that is sharp; units of the scan."""

    radius: float
    focus: float

    @classmethod
    def of(cls, camera: Camera, f_number: float, metres: float, focus: float) -> Lens:
        """By its f-number on full frame. metres: in a unit of the scan."""
        size = max(camera.width, camera.height)
        focal_mm = SENSOR_MM * camera.intrinsics.fx / size
        return cls(focal_mm / f_number / 2 / 1000 / metres, focus)

    def views(self, camera: Camera) -> list[Camera]:
        """The same picture from places all over the pupil, which agree at the focus and are apart
        by parts of a pixel, so that their mean has smooth edges.

        Haeberli and Akeley, "The accumulation buffer", SIGGRAPH 1990.
        """
        out, k = [], camera.intrinsics
        for number in range(PLACES):
            r, turn = self.radius * np.sqrt((number + 0.5) / PLACES), number * GOLDEN
            x, y = r * np.cos(turn), r * np.sin(turn)
            dx, dy = (number * 0.7548776662 % 1) - 0.5, (number * 0.5698402910 % 1) - 0.5
            lens = replace(
                k, cx=k.cx + k.fx * x / self.focus + dx, cy=k.cy + k.fy * y / self.focus + dy
            )
            pose = Pose(camera.pose.R, camera.pose.t - np.array([x, y, 0.0]))
            out.append(replace(camera, intrinsics=lens, pose=pose))
        return out


def falloff(camera: Camera) -> Floats:
    """(h, w) what comes through the lens beside that in the middle: the cosine of the angle to the
    axis to the fourth power.
    """
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    k = camera.intrinsics
    square = ((x - k.cx) / k.fx) ** 2 + ((y - k.cy) / k.fy) ** 2
    return ((1 + square) ** -2).astype(np.float32)


def pictures_through(
    lens: Lens, renderer: Renderer, surface: LitSurface, light: Illumination,
    cameras: Iterable[Camera],
) -> Iterator[Floats]:  # fmt: skip
    """For each camera (h, w, 4), as `relit_pictures` has them, through a lens."""
    cameras = list(cameras)
    every = [view for camera in cameras for view in lens.views(camera)]
    layers = relit_pictures(renderer, surface, light, every, samples=1)
    for camera in cameras:
        total = np.zeros((camera.height, camera.width, 4), np.float32)
        for _ in range(PLACES):
            total += next(layers)
        yield darkened(total / np.float32(PLACES), camera)


def darkened(layers: Floats, camera: Camera) -> Floats:
    """(h, w, 4) with the lens's falloff."""
    return np.concatenate([layers[..., :3] * falloff(camera)[..., None], layers[..., 3:]], axis=2)
