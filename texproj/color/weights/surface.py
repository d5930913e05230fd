"""How a camera sees the surface, owner by owner (face or vertex): what turns away, what is
resolved how finely. Occlusion is decided point by point, in `sample`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.points.source import Owners
from texproj.options import ColorOptions

DEPTH_TOLERANCE = 1e-3
"""Part of the distance by which a visible point may lie behind the rendered depth: float32 depth
and the mesh's own noise."""

DEPTH_TOLERANCE_PX = 1.5
"""Pixels of the depth image by which point and depth sample may be apart, times the slope."""

MIN_COS_ANGLE = 0.05
"""Surface turned away from the camera further than this cosine gets no color from it: at 87 degrees
a pixel of error in depth moves the color by twenty."""
STEEPEST = 20.0
"""Largest slope (tangent of the view angle) for which the tolerance still grows."""

SHARPER = 0.2
"""Octaves by which the pyramid level errs towards the sharper side."""


@dataclass(frozen=True, eq=False)
class SurfaceView:
    """How one photo sees the owners of points.

    weight: (k,) float32 product of the surface factors, 0 = faces away or behind the camera;
    nearer: (k,) float32 factor just under 1: a point is hidden only if the depth image is nearer
    than its own depth times this;
    level: (k,) int8 pyramid level whose pixels fit the points, None where it is the first for all;
    origin: (3,) that of the owners.
    """

    origin: NDArray[np.float64]
    weight: Floats
    nearer: Floats
    level: NDArray[np.int8] | None


def surface_view(
    owners: Owners, camera: Camera, depth_camera: Camera, levels: int, options: ColorOptions
) -> SurfaceView:
    """How a photo with so many pyramid levels sees the owners."""
    cosine = facing(owners, camera)
    seen = cosine > np.float32(MIN_COS_ANGLE)
    cosine = np.where(seen, cosine, np.float32(1))
    pixels = resolution(owners, camera)
    weight = np.where(seen & (pixels > 0), np.float32(1), np.float32(0))
    for factor in surface_factors(cosine, pixels, options).values():
        weight *= factor
    slope = np.clip(np.sqrt(np.maximum(1 - cosine * cosine, 0)) / cosine, 1, STEEPEST)
    footprint = DEPTH_TOLERANCE_PX / depth_camera.intrinsics.fx
    octave = np.log2(np.maximum(pixels * np.sqrt(cosine), 1)) - SHARPER
    level = np.clip(np.round(octave), 0, max(levels - 1, 0)).astype(np.int8)
    nearer = (1 - DEPTH_TOLERANCE - footprint * slope).astype(np.float32)
    return SurfaceView(owners.origin, weight, nearer, level if level.any() else None)


def surface_factors(cosine: Floats, pixels: Floats, options: ColorOptions) -> dict[str, Floats]:
    """Each (k,) float32 factor by name.

    angle: cosine between normal and line of sight; density: pixels of the photo per point,
    seen frontally, along a line squared, saturated at one.
    """
    return {
        "angle": cosine ** np.float32(options.angle_power),
        "density": np.minimum(pixels * pixels, 1) ** np.float32(options.density_power),
    }


def facing(owners: Owners, camera: Camera) -> Floats:
    """(k,) cosine of the angle between normal and line of sight; negative on back faces."""
    to_eye = (camera.center - owners.origin).astype(np.float32) - owners.center
    along = np.einsum("ij,ij->i", to_eye, owners.normal)
    length = np.sqrt(np.einsum("ij,ij->i", to_eye, to_eye))
    return along / np.maximum(length, np.float32(1e-30))


def resolution(owners: Owners, camera: Camera) -> Floats:
    """(k,) pixels of the photo per point along a line, seen frontally; 0 behind the camera."""
    axis = camera.pose.R[2].astype(np.float32)
    depth = np.einsum("kc,c->k", owners.center, axis)  # a product would wake every thread of BLAS
    depth += np.float32(camera.pose.apply(owners.origin[None])[0, 2])
    if camera.intrinsics.is_fisheye:
        depth = _even_distance(owners, camera, depth)
    focal = np.float32(np.sqrt(camera.intrinsics.fx * camera.intrinsics.fy))
    pixels = focal * owners.spacing / np.where(depth > 0, depth, np.float32(np.inf))
    return pixels.astype(np.float32)


def _even_distance(owners: Owners, camera: Camera, depth: Floats) -> Floats:
    """(k,) what takes the place of depth for a fisheye, whose pixels all span about one angle.

    At an angle t off the axis it has t / sin t pixels per unit of solid angle, in units of the
    squared focal length.
    """
    to_eye = (camera.center - owners.origin).astype(np.float32) - owners.center
    distance = np.sqrt(np.einsum("ij,ij->i", to_eye, to_eye))
    angle = np.arccos(np.clip(depth / np.maximum(distance, np.float32(1e-30)), -1, 1))
    even = distance * np.sqrt(np.sinc(angle / np.pi))
    return np.where(depth > 0, even, np.float32(0)).astype(np.float32)
