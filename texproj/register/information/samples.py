"""Points of the mesh that a rendering shows, with what it shows there: images to be compared
with a photo that need not be rendered again for every small move of the camera.

Because the points stay the same while the camera moves, so does the foreground: a measure over
them cannot grow by moving the mesh's border over something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats, Mask
from texproj.camera import Camera
from texproj.options import MapName
from texproj.render.gbuffer import GBuffer

RIM_PX = 1
"""Pixels along the outline that belong half to the background."""
WIDE, NARROW_PX = 0.06, 6.0
"""Width of the band on either side of the outline: as a share of the picture's longer side for a
rough comparison, in pixels for an exact one."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Points of the surface and what a rendering shows there.

    xyz_in_world: (n, 3); values: per map an (n,) float32 array in 0..1.
    """

    xyz_in_world: Doubles
    values: tuple[NDArray[np.float32], ...]

    def __len__(self) -> int:
        return len(self.xyz_in_world)

    def chosen(self, which: Mask) -> Samples:
        """A part of them."""
        return Samples(self.xyz_in_world[which], tuple(v[which] for v in self.values))


def surface_samples(
    images: GBuffer, camera: Camera, maps: Sequence[MapName], most: int, gradients: bool = False
) -> Samples:
    """At most about `most` of the foreground's pixels, evenly spread.

    camera: of the rendering's size; gradients: the maps' gradient strengths, not their values.
    """
    solid = images.outside()
    inner = cv2.erode(solid.astype(np.uint8), np.ones((2 * RIM_PX + 1,) * 2, np.uint8)) > 0
    y, x = _thinned(inner, most)
    xyz = images.points(camera, y, x)
    pictures = map_images(images, camera, maps)
    if gradients:
        pictures = [gradient_strength(p, inner) for p in pictures]
    return Samples(xyz, tuple(p[y, x] for p in pictures))


def outline_samples(images: GBuffer, camera: Camera, most: int, distances: bool) -> Samples:
    """Points on both sides of the outline: labelled 1 on the mesh and 0 beside it, or, with
    `distances`, by their distance to it, 1 = the width of a narrow band.

    A point beside the mesh is taken at the depth of the nearest point of the mesh, so that it
    moves with the outline.
    """
    solid = images.outside()
    if not solid.any() or solid.all():
        return Samples(np.zeros((0, 3)), (np.zeros(0, np.float32),))
    reach = NARROW_PX if distances else WIDE * max(camera.width, camera.height)
    outside, nearest = cv2.distanceTransformWithLabels(
        (~solid).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    inside = cv2.distanceTransform(solid.astype(np.uint8), cv2.DIST_L2, 5)
    y, x = _thinned((outside < reach) & (inside < reach), most)
    depth_of_label = np.zeros(int(nearest.max()) + 1)
    depth_of_label[nearest[solid]] = images.require("depth")[solid]
    xyz = camera.unproject(np.stack([x, y], axis=1) + 0.5, depth_of_label[nearest[y, x]])
    if not distances:
        return Samples(xyz, (solid[y, x].astype(np.float32),))
    away = np.where(solid, inside, outside)[y, x] - np.float32(0.5)
    return Samples(xyz, (np.clip(away / np.float32(reach), 0, 1),))


def _thinned(mask: Mask, most: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of pixels of `mask`: all, or a regular part of them."""
    y, x = np.nonzero(mask)
    if len(y) <= most:
        return y, x
    # steps of the golden ratio in x, so that no direction is sampled in a pattern
    keep = np.modf(0.6180339887 * x + 0.7548776662 * y)[0] < most / len(y)
    return y[keep], x[keep]


def map_images(images: GBuffer, camera: Camera, maps: Sequence[MapName]) -> list[Floats]:
    """(h, w) float32 images in 0..1 of the maps' components, one or three for each map.

    Parameters of the blends as in Corsini et al., "Image-to-geometry registration: a mutual
    information method exploiting illumination-related geometric properties", Pacific Graphics
    2009: occlusion where it is dark, normals where it is open.
    """
    out: list[Floats] = []
    for name in maps:
        if name == "silhouette":
            continue
        out += _components(images, camera, name)
    return out


def _components(images: GBuffer, camera: Camera, name: MapName) -> list[Floats]:
    if name == "ao":
        return [images.require("ao")]
    normal = images.require("normal")
    if name in ("normal-x", "normal-y", "normal-z"):
        return [normal[..., "xyz".index(name[-1])] * np.float32(0.5) + np.float32(0.5)]
    directed = _reflected(images, camera) if name.startswith("reflection") else normal
    pictures = [directed[..., k] * np.float32(0.5) + np.float32(0.5) for k in range(3)]
    if name in ("combined", "reflection-combined"):
        ao = images.require("ao")
        open_share = ao * ao
        pictures = [(1 - open_share) * ao + open_share * p for p in pictures]
    return pictures


def _reflected(images: GBuffer, camera: Camera) -> Floats:
    """(h, w, 3) the view direction mirrored at the surface, unit vectors in camera axes."""
    normal, k = images.require("normal"), camera.intrinsics
    x, y = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    view = np.stack([(x - k.cx) / k.fx, (y - k.cy) / k.fy, np.ones_like(x)], axis=2)
    view = (view / np.linalg.norm(view, axis=2, keepdims=True)).astype(np.float32)
    along = np.einsum("ijk,ijk->ij", view, normal)[..., None]
    return view - 2 * along * normal


def gradient_strength(image: Floats, valid: Mask | None = None) -> Floats:
    """(h, w) float32 length of the gradient, square root taken and scaled to 0..1 by its 98th
    percentile; without what the border of `valid` adds.
    """
    dx = cv2.Sobel(image, cv2.CV_32F, 1, 0, ksize=3)
    dy = cv2.Sobel(image, cv2.CV_32F, 0, 1, ksize=3)
    strength = np.sqrt(cv2.magnitude(dx, dy))
    inner = strength if valid is None else strength[valid]
    top = float(np.percentile(inner, 98)) if inner.size else 0.0
    return np.minimum(strength / max(top, 1e-6), 1).astype(np.float32)
