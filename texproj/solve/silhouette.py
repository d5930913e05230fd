"""Outlines: how far apart two of them are, and from where a solid has a given one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from texproj.arrays import Doubles, Mask
from texproj.camera import Camera
from texproj.opencv import opencv_places
from texproj.solve.reprojection import Prior, Reprojection, intrinsic_step, projection_jacobian

ANGLES, RADII = 72, 24
"""Samples of a signature around the middle and outwards."""
EXTENT = 1.9
"""Largest radius of a signature, in radii of the disk of the mask's area."""


def signed_distance(mask: Mask) -> NDArray[np.float32]:
    """(h, w) float32 distance in pixels to the outline of `mask`, negative inside.

    The outline runs halfway between pixels; the picture's border is no outline.
    """
    inside = mask.astype(np.uint8)
    outwards = cv2.distanceTransform(1 - inside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inwards = cv2.distanceTransform(inside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.where(mask, 0.5 - inwards, outwards - 0.5).astype(np.float32)


def outline(mask: Mask) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the pixels of `mask` that touch its outside; the picture's border is
    no outside."""
    border = {"borderType": cv2.BORDER_CONSTANT, "borderValue": 1}
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    inner = cv2.erode(mask.astype(np.uint8), cross, **border) > 0
    y, x = np.nonzero(mask & ~inner)
    return y, x


def xor_share(a: Mask, b: Mask) -> float:
    """Area that is in one of two masks only, over the area in either: 0 = equal, 1 = disjoint
    (Lensch, Heidrich and Seidel, "A silhouette-based algorithm for texture registration and
    stitching", Graphical Models 2001, minimize this area). 1 if both are empty.
    """
    either = np.count_nonzero(a | b)
    return float(np.count_nonzero(a ^ b)) / either if either else 1.0


@dataclass(frozen=True, eq=False)
class OutlineDistance:
    """Least squares of the distance of (n, 3) points, on the outline of the mesh, to the outline
    of a mask, pixels over `sigma_px`.

    distance: `signed_distance` of the mask; expected_px: its value at the points' pixels if all
    fits; free, priors: as in `Reprojection`.
    """

    xyz_in_world: Doubles
    distance: NDArray[np.float32]
    sigma_px: float = 1.0
    expected_px: float = 0.0
    free: tuple[str, ...] = ()
    priors: tuple[Prior, ...] = ()

    def residual(self, camera: Camera) -> Doubles:
        """(n, 1); NaN outside of the picture."""
        found = self._sampled(self.distance, camera.project(self.xyz_in_world)[0])
        return ((found - self.expected_px) / self.sigma_px)[:, None]

    def jacobian(self, camera: Camera) -> Doubles:
        """(n, 1, 6 + len(free))."""
        xy = camera.project(self.xyz_in_world)[0]
        across = [cv2.Sobel(self.distance, cv2.CV_32F, *d, ksize=3, scale=1 / 8)
                  for d in ((1, 0), (0, 1))]  # fmt: skip
        slope = np.stack([np.nan_to_num(self._sampled(g, xy)) for g in across], axis=1)
        moved = projection_jacobian(camera, self.xyz_in_world, self.free)
        out: Doubles = np.einsum("ni,nip->np", slope, moved)[:, None] / self.sigma_px
        return out

    def step(self, camera: Camera, delta: Doubles) -> Camera:
        intrinsics = camera.intrinsics
        for name, change in zip(self.free, delta[6:], strict=True):
            intrinsics = intrinsic_step(intrinsics, name, change)
        return Camera(intrinsics, camera.pose.step(delta[:6]))

    def prior(self, camera: Camera) -> tuple[Doubles, Doubles]:
        empty = Reprojection(np.zeros((0, 2)), np.zeros((0, 3)), 1.0, self.free, self.priors)
        return empty.prior(camera)

    def _sampled(self, image: NDArray[np.float32], xy_px: Doubles) -> Doubles:
        height, width = image.shape
        outside = ~((xy_px >= 0) & (xy_px <= (width, height))).all(axis=1)
        found = cv2.remap(image, opencv_places(xy_px).reshape(-1, 1, 2), None,
                          cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # fmt: skip
        return np.where(outside, np.nan, found.ravel())


@dataclass(frozen=True, eq=False)
class Signature:
    """A mask free of its place and size, by angle and radius about its middle.

    polar: (ANGLES, RADII) float32; center_px: (2,); radius_px: of the disk of the same area.
    """

    polar: NDArray[np.float32]
    center_px: Doubles
    radius_px: float

    @classmethod
    def of(cls, mask: Mask) -> Signature | None:
        """None for an empty mask."""
        moments = cv2.moments(mask.astype(np.uint8), binaryImage=True)
        area = moments["m00"]
        if not area:
            return None
        center = np.array([moments["m10"], moments["m01"]]) / area
        radius = float(np.sqrt(area / np.pi))
        angle = np.arange(ANGLES) * (2 * np.pi / ANGLES)
        # equal areas per ring, so that each sample counts alike
        reach = EXTENT * radius * np.sqrt((np.arange(RADII) + 0.5) / RADII)
        x = (center[0] + np.cos(angle)[:, None] * reach).astype(np.float32)
        y = (center[1] + np.sin(angle)[:, None] * reach).astype(np.float32)
        polar = cv2.remap(mask.astype(np.float32), x, y, cv2.INTER_LINEAR)
        return cls(polar, center + 0.5, radius)


def best_turns(
    wanted: Signature, views: NDArray[np.float32], each: int
) -> list[tuple[float, int, float]]:
    """(overlap, view, roll in rad) of the `each` best turns of every view, best first.

    views: (n, ANGLES, RADII) signatures; a view turned clockwise in the picture by its roll has
    the wanted outline. overlap: intersection over union.
    """
    target = fft.rfft(wanted.polar, axis=0)
    common = fft.irfft(target * np.conj(fft.rfft(views, axis=1)), ANGLES, axis=1).sum(axis=2)
    union = wanted.polar.sum() + views.sum(axis=(1, 2))[:, None] - common
    overlap = common / np.maximum(union, 1e-6)
    peaks = (overlap >= np.roll(overlap, 1, axis=1)) & (overlap > np.roll(overlap, -1, axis=1))
    ranked = np.where(peaks, overlap, -1)
    turns = np.argsort(-ranked, axis=1)[:, :each]
    found = [
        (float(ranked[view, turn]), view, float(turn) * 2 * np.pi / ANGLES)
        for view in range(len(views)) for turn in turns[view] if ranked[view, turn] > 0
    ]  # fmt: skip
    return sorted(found, key=lambda f: -f[0])


def sphere_directions(count: int) -> Doubles:
    """(count, 3) unit vectors spread evenly over the sphere (Fibonacci lattice)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def splatted(xy_px: Doubles, width: int, height: int) -> Mask:
    """(h, w) mask of dense points' pixels; holes of a pixel are closed."""
    inside = np.all((xy_px >= 0) & (xy_px < (width, height)), axis=1)
    x, y = xy_px[inside].astype(int).T
    mask = np.zeros((height, width), np.uint8)
    mask[y, x] = 1
    return cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0
