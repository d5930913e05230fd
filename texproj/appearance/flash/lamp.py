"""The flash: where it is, and how its light spreads over directions and over the picture."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera

OF_SENSOR = {
    1: ((1, 0), (0, 1)), 2: ((-1, 0), (0, 1)), 3: ((-1, 0), (0, -1)), 4: ((1, 0), (0, -1)),
    5: ((0, 1), (1, 0)), 6: ((0, -1), (1, 0)), 7: ((0, -1), (-1, 0)), 8: ((0, 1), (-1, 0)),
}  # fmt: skip
"""How each EXIF orientation turns the right and the down of the sensor into the upright photo's."""

ANGLE_SCALE = 3.0
"""Of 1 - cosine in the profile, so that its coefficients are of one size up to 48 degrees."""


@dataclass(frozen=True, eq=False)
class Lamp:
    """A point of light that moves with the camera.

    place: (3,) from the lens, in units of the mesh, camera axes (x right, y down, z forward) of the
    camera held as its sensor is; axis: (3,) unit, where it shines, the same axes; profile: of log
    intensity, coefficients of powers 1, 2, ... of `ANGLE_SCALE` (1 - cosine to the axis); widest:
    cosine of the largest angle that the profile is known to, beyond which nothing is used;
    vignetting: of log light in the picture, coefficients of powers of the squared distance from
    the picture's middle over that of its corner; reach: up to where they are known, beyond which
    nothing is used either; intensity: light at unit distance along the axis
    where a photo's white is 1 and base color 1 sends out 1 / pi of it, None where it is unknown.
    """

    place: Doubles
    axis: Doubles = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    profile: tuple[float, ...] = ()
    widest: float = -1.0
    vignetting: tuple[float, ...] = ()
    reach: float = np.inf
    intensity: float | None = None

    @property
    def bare(self) -> bool:
        """Whether it shines alike in all directions, through a lens that loses nothing."""
        return self.widest <= -1 and not self.vignetting

    def in_world(self, camera: Camera, orientation: int = 1) -> tuple[Doubles, Doubles]:
        """(3,) place and (3,) axis in the world for an upright photo; orientation: the EXIF one
        that made it upright.
        """
        turn = np.eye(3)
        turn[:2, :2] = OF_SENSOR.get(orientation, OF_SENSOR[1])
        place = camera.pose.inverse.apply((turn @ self.place)[None])[0]
        return place, camera.pose.R.T @ (turn @ self.axis)

    def strength(self, cosine: Floats) -> Floats:
        """(n,) intensity against that along the axis, at cosines to it; 0 beyond `widest`."""
        if not self.profile and self.widest <= -1:
            return np.ones_like(cosine)
        away = np.float32(ANGLE_SCALE) * (1 - cosine)
        out = np.exp(polynomial(self.profile, away))
        return np.where(cosine >= self.widest, out, 0).astype(np.float32)

    def falloff(self, camera: Camera, xy_px: Doubles) -> Floats:
        """(n,) light that the lens lets through at pixels, against that in the middle; 0 beyond
        `reach`.
        """
        rho = corner_part(camera, xy_px)
        out = np.exp(polynomial(self.vignetting, rho))
        return np.where(rho <= self.reach, out, 0).astype(np.float32)


def corner_part(camera: Camera, xy_px: Doubles) -> Doubles:
    """(n,) squared distance from the picture's middle over that of its corner."""
    half = np.array([camera.width, camera.height]) / 2
    return ((xy_px - half) ** 2).sum(axis=1) / (half**2).sum()


def polynomial(coefficients: tuple[float, ...], x: Doubles | Floats) -> Doubles | Floats:
    """Sum of coefficients times powers 1, 2, ... of x."""
    out = np.zeros_like(x)
    for coefficient in reversed(coefficients):
        out = (out + coefficient) * x
    return out
