"""Light from far away, as a picture of all directions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from texproj.arrays import Bools, Doubles, Floats
from texproj.photo import LUMINANCE
from texproj.render.directions import tangents

LARGEST = (1024, 512)
"""Width and height to which pictures are reduced: a mirror shows no more of them here."""
ROUGHNESSES = (0.15, 0.3, 0.5, 0.75, 1.0)
"""Of the blurred copies, with 0 before them."""
SOURCES = (512, 256, 128, 64, 64)
"""Width of the picture from which each is made: a texel is a part of the lobe."""
SAMPLES = 96
"""Directions of the lobe that each texel of a blurred copy is the mean of."""
BLURRED = (128, 64)
SUN_OVER_MEAN = 20.0
"""How much brighter than the mean of the picture a sun is."""
SUN_WIDE_DEG = 5.0
SUN_SHARE = 0.1
"""Part of the light from which a bright spot is a lamp of its own."""
GROUND = 0.2
"""Reflectance of the ground below an overcast sky."""


@dataclass(frozen=True, eq=False)
class Environment:
    """radiance: (h, w, 3) float32 linear, equirectangular, its middle `ahead`, its top row `up`;
    up, ahead: (3,) unit vectors at right angles, world.
    """

    radiance: Floats
    up: Doubles
    ahead: Doubles

    def looked_up(self, directions: Floats, roughness: Floats | float) -> Floats:
        """(n, 3) radiance from (n, 3) unit vectors, blurred as a mirror of that roughness blurs.

        Split-sum approximation: B. Karis, "Real shading in Unreal Engine 4", 2013.
        """
        level = np.interp(roughness, (0.0, *ROUGHNESSES), range(len(ROUGHNESSES) + 1))
        level = np.broadcast_to(np.asarray(level, np.float32), len(directions))
        out = np.zeros((len(directions), 3), np.float32)
        for number, picture in enumerate(self._levels):
            weight = 1 - np.abs(level - number)
            rows = np.flatnonzero(weight > 0)
            if len(rows):
                out[rows] += weight[rows, None] * _at(picture, self._local(directions[rows]))
        return out

    def soft(self, directions: Floats) -> Floats:
        """(n, 3) radiance blurred to some degrees, for few rays."""
        return _at(self._small, self._local(directions))

    @cached_property
    def _small(self) -> Floats:
        return _reduced(self.radiance, 64)

    @cached_property
    def _levels(self) -> tuple[Floats, ...]:
        """The picture, and its copies blurred by `ROUGHNESSES`."""
        blurred = [
            _blurred(_reduced(self.radiance, source), roughness)
            for roughness, source in zip(ROUGHNESSES, SOURCES, strict=True)
        ]
        return (_reduced(self.radiance, LARGEST[0]), *blurred)

    def _local(self, directions: Floats) -> Floats:
        """(n, 3) to the right, up, ahead."""
        axes = np.stack([np.cross(self.ahead, self.up), self.up, self.ahead])
        return directions @ axes.T.astype(np.float32)

    def parted(self) -> tuple[Environment, Doubles | None, Doubles | None]:
        """The environment without its sun, (3,) the direction of the sun, world, and (3,) its
        illuminance square to it; itself, None and None where no spot is so bright.
        """
        local, solid = all_directions(self.radiance.shape[1], self.radiance.shape[0])
        light = self.radiance @ LUMINANCE
        mean = float((light * solid).sum() / solid.sum())
        brightest = local.reshape(-1, 3)[light.argmax()]
        near: Bools = local @ brightest > np.cos(np.radians(SUN_WIDE_DEG))
        bright: Bools = near & (light > SUN_OVER_MEAN * mean)
        power = (self.radiance * (solid * bright)[..., None]).sum(axis=(0, 1), dtype=np.float64)
        if not bright.any() or power @ LUMINANCE < SUN_SHARE * float((light * solid).sum()):
            return self, None, None
        weight = (light * solid * bright)[..., None]
        right, up, ahead = _unit((local * weight).sum(axis=(0, 1), dtype=np.float64))
        toward = right * np.cross(self.ahead, self.up) + up * self.up + ahead * self.ahead
        rest = self.radiance.copy()
        around = near & ~bright
        rest[bright] = np.median(rest[around], axis=0) if around.any() else mean
        return Environment(rest, self.up, self.ahead), toward, power


def overcast(up: Doubles, ahead: Doubles, illuminance: float) -> Environment:
    """The CIE's overcast sky, three times as bright overhead as at the horizon (Moon and Spencer
    1942), above ground that reflects `GROUND`. illuminance: of level ground, lux.
    """
    local, _ = all_directions(64, 32)
    height = local[..., 1]
    zenith = 9 / (7 * np.pi) * illuminance
    sky = zenith * (1 + 2 * height) / 3
    gray = np.where(height > 0, sky, GROUND * illuminance / np.pi).astype(np.float32)
    return Environment(np.repeat(gray[..., None], 3, axis=2), up, ahead)


def all_directions(width: int, height: int) -> tuple[Floats, Floats]:
    """(h, w, 3) directions of texels, to the right, up, ahead, and (h, w) their solid angles."""
    around = (np.arange(width, dtype=np.float32) + 0.5) / width * 2 * np.pi - np.pi
    above = np.pi / 2 - (np.arange(height, dtype=np.float32) + 0.5) / height * np.pi
    level = np.cos(above)[:, None]
    up = np.broadcast_to(np.sin(above)[:, None], (height, width))
    directions = np.stack([level * np.sin(around), up, level * np.cos(around)], axis=-1)
    solid = level * np.ones(width, np.float32) * (2 * np.pi / width) * (np.pi / height)
    return directions.astype(np.float32), solid.astype(np.float32)


def _at(picture: Floats, local: Floats) -> Floats:
    """(n, 3) values in (n, 3) directions, between texels bilinearly."""
    height, width = picture.shape[:2]
    x = (np.arctan2(local[:, 0], local[:, 2]) / (2 * np.pi) + 0.5) * width - 0.5
    y = (0.5 - np.arcsin(np.clip(local[:, 1], -1, 1)) / np.pi) * height - 0.5
    x0, y0 = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    right, below = (x - x0)[:, None], (y - y0)[:, None]
    top, bottom = np.clip(y0, 0, height - 1), np.clip(y0 + 1, 0, height - 1)
    left, next_ = x0 % width, (x0 + 1) % width
    upper = picture[top, left] * (1 - right) + picture[top, next_] * right
    lower = picture[bottom, left] * (1 - right) + picture[bottom, next_] * right
    out: Floats = (upper * (1 - below) + lower * below).astype(np.float32)
    return out


def _reduced(picture: Floats, width: int) -> Floats:
    if picture.shape[1] <= width:
        return picture
    return cv2.resize(picture, (width, width // 2), interpolation=cv2.INTER_AREA)


def _blurred(picture: Floats, roughness: float) -> Floats:
    """The mean of what facets of a GGX mirror show that is looked at from straight ahead."""
    width, height = BLURRED
    axis = all_directions(width, height)[0].reshape(-1, 3)
    right, along = tangents(axis)
    number = np.arange(SAMPLES)
    u, angle = (number + 0.5) / SAMPLES, number * np.pi * (3 - np.sqrt(5))
    alpha2 = roughness**4
    cosine2 = (1 - u) / (1 + (alpha2 - 1) * u)  # Walter et al. 2007, eq. 35
    out, total = np.zeros((len(axis), 3), np.float32), 0.0
    for c2, turn in zip(cosine2, angle, strict=True):
        toward = 2 * c2 - 1  # of the mirrored direction to the axis
        if toward <= 0:
            continue
        across = np.float32(np.sqrt(1 - toward**2))
        side = np.float32(np.cos(turn)) * right + np.float32(np.sin(turn)) * along
        out += np.float32(toward) * _at(picture, (toward * axis + across * side).astype(np.float32))
        total += toward
    return (out / np.float32(total)).reshape(height, width, 3)


def _unit(vector: Doubles) -> Doubles:
    out: Doubles = vector / np.linalg.norm(vector)
    return out
