"""From light to an encoded picture: defocus, exposure, noise, clipping, sRGB."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.photo import srgb_from_linear


@dataclass(frozen=True)
class Sensor:
    """ev: exposure steps against the normal exposure; balance: gain per channel;
    full_well: electrons at white, whose counting noise is seen (0 = no noise at all);
    read_noise: standard deviation in the dark, as a share of white.
    """

    ev: float = 0.0
    balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    full_well: float = 15000.0
    read_noise: float = 0.0015


def developed(light: Floats, sensor: Sensor, rng: np.random.Generator) -> NDArray[np.uint8]:
    """(h, w, 3) linear light to 8-bit sRGB: exposed, with shot and read noise, clipped."""
    value = light * (np.float32(2.0**sensor.ev) * np.asarray(sensor.balance, np.float32))
    if sensor.full_well:
        deviation = np.sqrt(np.maximum(value, 0) / sensor.full_well + sensor.read_noise**2)
        value = value + deviation * rng.standard_normal(value.shape, np.float32)
    return np.round(srgb_from_linear(value) * 255).astype(np.uint8)


def defocused(light: Floats, radius_px: float) -> Floats:
    """The picture blurred by a disk, as by a lens focused elsewhere."""
    if radius_px <= 0:
        return light
    reach = int(np.ceil(radius_px))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disk = np.clip(radius_px + 0.5 - np.hypot(x, y), 0, 1).astype(np.float32)
    return cv2.filter2D(light, -1, disk / disk.sum(), borderType=cv2.BORDER_REFLECT)
