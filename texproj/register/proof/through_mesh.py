"""Photos with what the mesh looks like from their cameras, and one warped into another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats, Index
from texproj.camera import Camera, Intrinsics
from texproj.opencv import FAR_OUTSIDE
from texproj.photo import Photo
from texproj.register.joint.session import Cameras, Kept, LoadPhoto
from texproj.register.joint.ties import (
    DEPTH_TOLERANCE,
    PATCH_PX,
    RIM_PX,
    corner_grid,
    gradient_field,
)
from texproj.register.proof.texture import textured
from texproj.render import GBuffer, Render, ideal_grid
from texproj.solve.matching import PatchMatches, match_patches
from texproj.solve.orientation import DARK, Field

KEPT_PHOTOS, KEPT_VIEWS = 48, 8
"""How many reduced photos, and how many of them with their renderings, stay in memory."""
RADIUS_PX = 8
"""How far a patch is sought, working pixels: cameras before refinement are off by up to .5 % each.
"""
CLOSE_PX = 2.0
"""Places closer than this are one."""
MOST_PATCHES, LEAST_PATCHES = 160, 25
"""Of a pair, spread evenly: enough to tell any share to some percent; and with fewer a pair says
nothing."""


@dataclass(frozen=True, eq=False)
class PhotoView:
    """One photo ready for comparison: its camera at the working size, its luma in 0..1, what the
    mesh looks like from there (depth, normal), and where it may be used.
    """

    camera: Camera
    gray: Floats
    images: GBuffer
    valid: NDArray[np.bool_]

    @cached_property
    def gradients(self) -> Field:
        return gradient_field(self.gray)

    @cached_property
    def corners(self) -> Floats:
        """(h, w) how well a patch around a pixel can be located."""
        return cv2.cornerMinEigenVal(np.log(self.gray + np.float32(DARK)), PATCH_PX)

    @cached_property
    def xyz_in_cam(self) -> NDArray[np.float32]:
        """(h, w, 3) the surface under each pixel, in camera axes; NaN where there is none."""
        depth = np.where(self.valid, self.images.require("depth"), np.nan)[..., None]
        ideal = ideal_grid(self.camera.intrinsics)
        return np.concatenate([ideal * depth, depth], axis=2).astype(np.float32)


class Lookup(Protocol):
    """The views by number of the photo."""

    def __getitem__(self, k: int, /) -> PhotoView: ...


class Views:
    """Photos with their renderings at one working size, for given cameras."""

    def __init__(
        self, cameras: Cameras, photos: Kept[tuple[int, int], Photo], longest: int,
        load_photo: LoadPhoto, render: Render,
    ) -> None:  # fmt: skip
        self._cameras, self._photos, self._longest = cameras, photos, longest
        self._load, self._render = load_photo, render
        self._kept: Kept[int, PhotoView] = Kept(KEPT_VIEWS)

    def __getitem__(self, k: int) -> PhotoView:
        return self._kept.fetch(k, lambda: self._make(k))

    def _make(self, k: int) -> PhotoView:
        key = (k, self._longest)
        photo = self._photos.fetch(key, lambda: self._load(k, self._longest))
        return made_view(photo, self._cameras[k], self._render)


def made_view(photo: Photo, camera: Camera, render: Render) -> PhotoView:
    """Bring a photo, reduced as it is, and a rendering from its camera (full size) together."""
    camera = camera.resized(photo.width, photo.height)
    images = render(camera)
    valid = np.isfinite(images.require("depth"))
    if photo.mask is not None:
        valid &= photo.mask > 0
    return PhotoView(camera, photo.gray(), images, valid)


def warped(here: PhotoView, other: PhotoView) -> tuple[Floats, NDArray[np.bool_]]:
    """(h, w) luma of `other` in the picture of `here`, and where both see the same surface."""
    other_from_here = other.camera.pose @ here.camera.pose.inverse
    matrix = np.concatenate([other_from_here.R, other_from_here.t[:, None]], axis=1)
    xyz = cv2.transform(here.xyz_in_cam, matrix)
    depth = xyz[..., 2]
    at = _pixels(other.camera.intrinsics, xyz)
    outside = {"borderMode": cv2.BORDER_CONSTANT, "borderValue": 0}
    there = cv2.remap(other.images.require("depth"), at, None, cv2.INTER_NEAREST, **outside)
    usable = cv2.remap(other.valid.astype(np.uint8), at, None, cv2.INTER_NEAREST, **outside)
    with np.errstate(invalid="ignore"):
        shared = (usable > 0) & (np.abs(there - depth) < DEPTH_TOLERANCE * depth)
    gray = cv2.remap(other.gray, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.where(shared, gray, here.gray), shared


def _pixels(k: Intrinsics, xyz_in_cam: NDArray[np.float32]) -> NDArray[np.float32]:
    """(h, w, 2) where points are in the picture, from the center of its first pixel as OpenCV
    counts; far outside where they are not seen.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        ideal = xyz_in_cam[..., :2] / xyz_in_cam[..., 2:]
    if k.distorted:
        ideal = k.distort(ideal.reshape(-1, 2)).reshape(ideal.shape)
    at = ideal * np.array([k.fx, k.fy], np.float32) + np.array([k.cx, k.cy], np.float32) - 0.5
    seen = np.isfinite(at).all(axis=2, keepdims=True) & (xyz_in_cam[..., 2:] > 0)
    return np.where(seen, at, FAR_OUTSIDE).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Shown:
    """What one photo shows of the surface that another sees, in the picture of the other. field:
    (h, w) its gradients; solid: (h, w) where both see all of a patch and there is something to be
    found; centers: (n, 2) of the patches that are sought.
    """

    field: Field
    solid: NDArray[np.bool_]
    centers: Index

    def found_in(self, image: Field, centers: Index | None = None) -> PatchMatches:
        """The patches, or those around other (n, 2) centers, where they are in (h, w) gradients."""
        centers = self.centers if centers is None else centers
        return match_patches(self.field, image, centers, PATCH_PX, RADIUS_PX)


def shown(here: PhotoView, other: PhotoView, to_the_rim: bool) -> Shown:
    """What `other` shows in the picture of `here`, to the rim of that, or as far as whole patches
    reach.
    """
    there, shared = warped(here, other)
    kernel = np.ones((2 * RIM_PX + 1,) * 2, np.uint8)
    seen = (shared & textured(here.gray)).astype(np.uint8)
    beyond = 1 if to_the_rim else 0
    solid = cv2.erode(seen, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=beyond) > 0
    centers = _thinned(corner_grid(here.corners, solid), MOST_PATCHES)
    return Shown(gradient_field(there), solid, centers)


def _thinned(centers: Index, most: int) -> Index:
    """At most so many of (n, 2) patches, spread evenly over their order."""
    keep = np.linspace(0, len(centers) - 1, min(most, len(centers))).round().astype(int)
    return centers[keep]
