"""How much a rendering of the bare mesh tells about a photo, for any camera close by."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.options import MutualInformationOptions
from texproj.photo import Photo
from texproj.register.structure_view import Render
from texproj.register.surface_samples import (
    Samples,
    foreground,
    gradient_strength,
    outline_samples,
    surface_samples,
)
from texproj.solve.mutual_information import (
    Array,
    Binned,
    Measure,
    binned,
    joint_histogram,
    mutual_information_bits,
    normalized_mutual_information,
)

Image = NDArray[np.float32]

BLUR_PX = 0.8
"""Smoothing of the reduced photo, so that sampling between pixels does not change its noise."""
TAIL = 0.5
"""Percent of the samples at either end of the gray values that are clipped."""
SURFACE_SAMPLES, OUTLINE_SAMPLES = 12_000, 4_000
LEAST_SAMPLES = 300
"""Samples below which there is too little of the mesh in view."""


@dataclass(frozen=True, eq=False)
class PhotoLevel:
    """A photo at one size. gray: (h, w) float32 of any range; usable: (h, w) float32 in 0..1."""

    gray: Image
    usable: Image | None

    @classmethod
    def of(cls, photo: Photo, longest_px: float, gradients: bool) -> PhotoLevel:
        factor = longest_px / max(photo.width, photo.height)
        if factor < 1:
            photo = photo.resized(round(photo.width * factor), round(photo.height * factor))
        gray = cv2.GaussianBlur(photo.gray(), (0, 0), BLUR_PX)
        usable = None if photo.mask is None else (photo.mask > 0).astype(np.float32)
        return cls(gradient_strength(gray) if gradients else gray, usable)

    def camera(self, camera: Camera) -> Camera:
        """`camera` for a picture of this size."""
        height, width = self.gray.shape
        return camera.resized(width, height)

    def sampled(self, xy_px: Array) -> tuple[Image, Image]:
        """((n,) gray, (n,) weight) at pixels; weight 0 outside of the picture and the mask."""
        height, width = self.gray.shape
        place = np.nan_to_num(xy_px - 0.5, nan=-9.0).astype(np.float32).reshape(-1, 1, 2)
        gray = cv2.remap(self.gray, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        x, y = place[:, 0].T
        weight = ((x > -0.5) & (y > -0.5) & (x < width - 0.5) & (y < height - 0.5)).astype(
            np.float32
        )
        if self.usable is not None:
            weight *= cv2.remap(self.usable, place, None, cv2.INTER_LINEAR).ravel()
        return gray.ravel(), weight


@dataclass(frozen=True, eq=False)
class Layer:
    """xyz_in_world: (n, 3); maps: what the mesh shows there, in bins."""

    xyz_in_world: Array
    maps: tuple[Binned, ...]


@dataclass(frozen=True, eq=False)
class Comparison:
    """A rendering from `camera` (of the level's size), ready to be held against the photo from
    cameras around it. area_px: size of the foreground; gray_range: lowest and highest gray of
    the histograms.
    """

    level: PhotoLevel
    camera: Camera
    layers: tuple[Layer, ...]
    area_px: float
    gray_range: tuple[float, float]
    bins: int
    measure: Measure

    @classmethod
    def at(
        cls, level: PhotoLevel, camera: Camera, render: Render, options: MutualInformationOptions
    ) -> Comparison | None:
        """None if too little of the mesh is in view."""
        here = level.camera(camera)
        images = render(here)
        surface = surface_samples(images, here, options.maps, SURFACE_SAMPLES, options.gradients)
        if len(surface) < LEAST_SAMPLES:
            return None
        gray = level.sampled(here.project(surface.xyz_in_world)[0])[0]
        layers = [_layer(surface, options.bins)] if surface.values else []
        if "silhouette" in options.maps:
            outline = outline_samples(images, here, OUTLINE_SAMPLES)
            layers += [_layer(outline, 2)] if len(outline) else []
        low, high = np.percentile(gray, (TAIL, 100 - TAIL))
        gray_range = (float(low), float(max(high, low + 1e-3)))
        area = float(foreground(images).sum())
        return cls(level, here, tuple(layers), area, gray_range, options.bins, options.measure)

    @property
    def points(self) -> Array:
        """(n, 3) surface points in view."""
        return self.layers[0].xyz_in_world

    def information(self, camera: Camera) -> float:
        """Bits (or excess of the normalized measure) that the maps tell about the photo, summed.

        Samples that leave the picture or the mask tell nothing: each layer counts by the share
        that is left, so that leaving never pays.
        """
        return float(sum(self._shared(layer, camera) for layer in self.layers))

    def _shared(self, layer: Layer, camera: Camera) -> float:
        xy = camera.project(layer.xyz_in_world)[0]
        gray, weight = self.level.sampled(xy)
        low, high = self.gray_range
        steps = binned((gray - low) / (high - low), self.bins)
        joints = [joint_histogram(steps, shown, weight) for shown in layer.maps]
        if self.measure == "normalized":
            told = sum(normalized_mutual_information(j) - 1 for j in joints)
        else:
            told = sum(mutual_information_bits(j) for j in joints)
        return told * float(weight.mean())


def _layer(samples: Samples, bins: int) -> Layer:
    return Layer(samples.xyz_in_world, tuple(binned(v, bins) for v in samples.values))
