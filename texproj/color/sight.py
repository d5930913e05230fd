"""Which points of the surface a photo sees, and how."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.color.points import Floats, SurfacePoints, facing
from texproj.color.view import PhotoView, lookup
from texproj.options import ColorOptions

DEPTH_TOLERANCE = np.float32(1e-3)
"""Part of the distance by which a visible point may lie behind the rendered depth: float32 depth
and the mesh's own noise."""

DEPTH_TOLERANCE_PX = np.float32(1.5)
"""Pixels of the depth image by which point and depth sample may be apart, times the slope."""

STEEPEST = np.float32(20.0)
"""Largest slope (tangent of the view angle) for which the tolerance still grows."""


@dataclass(frozen=True, eq=False)
class Sight:
    """The points that a photo sees, and how.

    index: (m,) which points; xy_px: (m, 2) float32 pixels of the photo; depth: (m,) float32;
    cos_angle: (m,) float32 between the normal and the line of sight; pixels: (m,) float32 edge of
    the square of photo pixels that falls on the square which the point stands for.
    """

    index: NDArray[np.intp]
    xy_px: Floats
    depth: Floats
    cos_angle: Floats
    pixels: Floats
    depth_xy: Floats


def sight_of(points: SurfacePoints, view: PhotoView, options: ColorOptions) -> Sight:
    """The points in the picture that face the camera and are hidden by nothing."""
    camera = view.depth_camera
    xyz = to_camera(points, camera)
    cos_angle = facing(points.xyz, points.normal, points.origin, view.camera)
    k = camera.intrinsics
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / xyz[:, 2]
        x, y = xyz[:, 0] * inverse, xyz[:, 1] * inverse
        u, v = x * np.float32(k.fx) + np.float32(k.cx), y * np.float32(k.fy) + np.float32(k.cy)
        candidate = (xyz[:, 2] > 0) & (cos_angle > np.float32(options.min_cos_angle))
        candidate &= (u >= 0) & (v >= 0) & (u < k.width) & (v < k.height)
    index = np.flatnonzero(candidate)
    cos_angle, depth = cos_angle[index], xyz[index, 2]
    depth_xy = np.stack([u[index], v[index]], axis=1)
    keep = unhidden(depth_xy, depth, cos_angle, view)
    xy_px = photo_pixels(np.stack([x[index], y[index]], axis=1), view.camera)
    keep &= view.camera.inside(xy_px)
    index, cos_angle, depth = index[keep], cos_angle[keep], depth[keep]
    focal = np.float32(view.camera.intrinsics.fx)
    pixels = focal / depth * points.spacing[index] * np.sqrt(cos_angle)
    return Sight(index, xy_px[keep], depth, cos_angle, pixels, depth_xy[keep])


def to_camera(points: SurfacePoints, camera: Camera) -> Floats:
    """(n, 3) float32 camera coordinates; the large offset is taken out in float64."""
    R, t = camera.pose.R, camera.pose.apply(points.origin)
    matrix = np.concatenate([R, t.reshape(3, 1)], axis=1).astype(np.float32)
    return cv2.transform(points.xyz.reshape(-1, 1, 3), matrix).reshape(-1, 3)


def photo_pixels(ideal: Floats, camera: Camera) -> Floats:
    """(m, 2) normalized pinhole coordinates to pixels of the photo, through the full lens model."""
    k = camera.intrinsics
    if k.distorted:
        ideal = k.distort(ideal).astype(np.float32)
    return ideal * np.float32((k.fx, k.fy)) + np.float32((k.cx, k.cy))


def unhidden(
    depth_xy: Floats, depth: Floats, cos_angle: Floats, view: PhotoView
) -> NDArray[np.bool_]:
    """(m,) whether nothing lies in front, with a tolerance relative to distance and slope."""
    rendered = lookup(view.depth, depth_xy)
    slope = np.sqrt(np.maximum(1 - cos_angle * cos_angle, 0)) / cos_angle
    footprint = DEPTH_TOLERANCE_PX / np.float32(view.depth_camera.intrinsics.fx)
    tolerance = DEPTH_TOLERANCE + footprint * np.clip(slope, 1, STEEPEST)
    return depth * (1 - tolerance) <= rendered
