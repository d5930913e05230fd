"""How much a rendering of the bare mesh tells about a photo, for any camera close by."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera, Intrinsics
from texproj.opencv import opencv_places
from texproj.options import MutualInformationOptions
from texproj.photo import Photo
from texproj.register.information.samples import (
    Samples,
    gradient_strength,
    outline_samples,
    surface_samples,
)
from texproj.render import Render
from texproj.render.gbuffer import GBuffer
from texproj.solve.mutual_information import (
    Binned,
    Measure,
    binned,
    joint_histogram,
    mutual_information_bits,
    normalized_mutual_information,
)

BINS = 32
"""Steps into which gray and rendered values are divided."""
BLUR_PX = 0.8
"""Smoothing of the reduced photo, so that sampling between pixels does not change its noise."""
TAIL = 0.5
"""Percent of the samples at either end of the gray values that are clipped."""
SURFACE_SAMPLES, OUTLINE_SAMPLES = 12_000, 4_000
MARGIN = 0.06
"""Part of the longer side added on each side of a distorted photo."""
OUTLINE_BINS = 8
LEAST_SAMPLES = 300
"""Samples below which there is too little of the mesh in view."""


@dataclass(frozen=True, eq=False)
class PhotoLevel:
    """A reduced photo without its lens distortion, so that a comparison needs no lens model.

    camera: the pinhole camera of this picture, which is a little larger than the photo;
    channels: (h, w, 3) float32, gray of any range, weight in 0..1, which is 0 outside of the
    photo and of its mask, and strength of the gradient, 0..1.
    """

    camera: Camera
    channels: Floats

    @classmethod
    def of(cls, photo: Photo, camera: Camera, longest_px: float, gradients: bool) -> PhotoLevel:
        """The photo reduced. camera: of the photo, any size; longest_px: of the reduced photo."""
        photo = photo.reduced(longest_px)
        gray = cv2.GaussianBlur(photo.gray(), (0, 0), BLUR_PX)
        edges = gradient_strength(gray)
        gray = edges if gradients else gray
        weight = np.ones_like(gray)
        if photo.mask is not None:
            weight = (photo.mask > 0).astype(np.float32)
        lens = camera.intrinsics.resized(photo.width, photo.height)
        wide = _widened(lens)
        return cls(
            Camera(wide, camera.pose), _undistorted(cv2.merge([gray, weight, edges]), lens, wide)
        )

    def sampled(self, xy_px: Doubles) -> Floats:
        """(n, 3) channels at pixels of this picture."""
        places = opencv_places(xy_px).reshape(-1, 1, 2)
        return cv2.remap(self.channels, places, None, cv2.INTER_LINEAR).reshape(-1, 3)


def _widened(lens: Intrinsics) -> Intrinsics:
    """The pinhole part, with a margin for what a barrel-shaped distortion draws in."""
    margin = round(MARGIN * max(lens.width, lens.height)) if lens.distorted else 0
    return replace(
        lens.pinhole, width=lens.width + 2 * margin, height=lens.height + 2 * margin,
        cx=lens.cx + margin, cy=lens.cy + margin,
    )  # fmt: skip


def _undistorted(picture: Floats, lens: Intrinsics, wide: Intrinsics) -> Floats:
    if not lens.distorted:
        return picture
    x, y = np.meshgrid(np.arange(wide.width) + 0.5, np.arange(wide.height) + 0.5)
    ideal = np.stack([(x - wide.cx) / wide.fx, (y - wide.cy) / wide.fy], axis=2)
    xy_px = lens.distort(ideal.reshape(-1, 2)) * (lens.fx, lens.fy) + (lens.cx, lens.cy)
    places = opencv_places(xy_px).reshape(wide.height, wide.width, 2)
    return cv2.remap(picture, places, None, cv2.INTER_LINEAR)


def _projected(camera: Camera, xyz_in_world: Doubles) -> Doubles:
    """(n, 2) pixels by a camera without distortion."""
    K, pose = camera.intrinsics.K, camera.pose
    xyz = pose.apply(xyz_in_world)
    depth = np.where(xyz[:, 2] > 0, xyz[:, 2], np.nan)
    return np.stack([xyz[:, k] * (K[k, k] / depth) + K[k, 2] for k in (0, 1)], axis=1)


@dataclass(frozen=True, eq=False)
class Layer:
    """Points of the surface that are compared with the photo in the same way.

    xyz_in_world: (n, 3); maps: what the mesh shows there, in bins; edges: to be compared with
    the photo's gradients, not its gray.
    """

    xyz_in_world: Doubles
    maps: tuple[Binned, ...]
    edges: bool = False


@dataclass(frozen=True, eq=False)
class Comparison:
    """A rendering from the level's camera, ready to be held against the photo from cameras
    around it. area_px: size of the foreground; gray_range: lowest and highest gray of
    the histograms.
    """

    level: PhotoLevel
    layers: tuple[Layer, ...]
    area_px: float
    gray_range: tuple[float, float]
    bins: int
    measure: Measure

    @classmethod
    def at(
        cls, level: PhotoLevel, render: Render, options: MutualInformationOptions, exact: bool
    ) -> Comparison | None:
        """None if too little of the mesh is in view.

        exact: compare the outline with the photo's edges, which lie where it is but are found
        from close by only; else what is inside of it with what is outside.
        """
        here = level.camera
        images = render(here)
        surface = surface_samples(images, here, options.maps, SURFACE_SAMPLES, options.gradients)
        if len(surface) < LEAST_SAMPLES:
            return None
        surface = _usable(surface, level)
        if len(surface) < LEAST_SAMPLES:
            return None
        layers = [_layer(surface, BINS)] if surface.values else []
        if "silhouette" in options.maps:
            layers += _outline_layers(images, level, exact)
        if not layers:
            return None
        gray = level.sampled(_projected(here, surface.xyz_in_world))[:, 0]
        low, high = np.percentile(gray, (TAIL, 100 - TAIL))
        gray_range = (float(low), float(max(high, low + 1e-3)))
        area = float(images.outside().sum())
        return cls(level, tuple(layers), area, gray_range, BINS, options.measure)

    @property
    def camera(self) -> Camera:
        return self.level.camera

    @property
    def points(self) -> Doubles:
        """(n, 3) surface points in view."""
        return self.layers[0].xyz_in_world

    def information(self, camera: Camera) -> float:
        """Bits (or excess of the normalized measure) that the maps tell about the photo, summed.

        Samples that leave the picture or the mask tell nothing: each layer counts by the share
        that is left, so that leaving never pays.
        """
        return float(sum(self._shared(layer, camera) for layer in self.layers))

    def _shared(self, layer: Layer, camera: Camera) -> float:
        gray, weight, edge = self.level.sampled(_projected(camera, layer.xyz_in_world)).T
        low, high = self.gray_range
        steps = binned(edge if layer.edges else (gray - low) / (high - low), self.bins)
        joints = [joint_histogram(steps, shown, weight) for shown in layer.maps]
        if self.measure == "normalized":
            shared = sum(normalized_mutual_information(j) - 1 for j in joints)
        else:
            shared = sum(mutual_information_bits(j) for j in joints)
        return shared * float(weight.mean())


def _outline_layers(images: GBuffer, level: PhotoLevel, exact: bool) -> list[Layer]:
    outline = outline_samples(images, level.camera, OUTLINE_SAMPLES, exact)
    if not len(outline):
        return []
    outline = _usable(outline, level)
    return [_layer(outline, OUTLINE_BINS if exact else 2, edges=exact)] if len(outline) else []


def _usable(samples: Samples, level: PhotoLevel) -> Samples:
    """Those that fall on the photo and its mask from the level's camera."""
    weight = level.sampled(_projected(level.camera, samples.xyz_in_world))[:, 1]
    return samples.chosen(weight > 0.5)


def _layer(samples: Samples, bins: int, edges: bool = False) -> Layer:
    return Layer(samples.xyz_in_world, tuple(binned(v, bins) for v in samples.values), edges)
