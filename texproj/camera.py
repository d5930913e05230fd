"""Cameras: rigid poses, intrinsics with OpenCV's distortion or fisheye, and what a pixel sees.

Frames: `world` is the mesh file's frame, `cam` has x right, y down, z forward.
Pixels: continuous image coordinates; the center of the top-left pixel is (0.5, 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from texproj import fisheye

Array = NDArray[np.float64]
LensModel = Literal["perspective", "fisheye"]

DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
"""Numbers of coefficients that OpenCV defines: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1..s4 [tx ty]]]]."""

LENGTHS: dict[LensModel, tuple[int, ...]] = {
    "perspective": DISTORTION_LENGTHS,
    "fisheye": fisheye.FISHEYE_LENGTHS,
}
"""Numbers of coefficients by lens model."""

NEGLIGIBLE_RADIAL = np.array([1e-27, 1e-21, 1e-15])
"""Of r^6, r^4, r^2: below, they move no point by 1e-9 within 89.9 degrees of the axis."""

MOST_COEFFICIENT = 1e60
"""Nothing is seen through a lens with larger ones, and their products overflow."""

UNDISTORT_ITERATIONS = 50
UNDISTORT_TOLERANCE = 1e-12
"""Largest step, in normalized image units, at which the undistortion has converged."""


def _frozen(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = np.array(values, dtype=np.float64).reshape(shape)
    array.flags.writeable = False
    return array


def _affine(xyz: Array, matrix: Array) -> Array:
    """(..., 3) points by a (3, 4) matrix. OpenCV's loop: a matrix product of this shape costs
    numpy up to seventy times as much.
    """
    if not xyz.size:
        return xyz.copy()
    import cv2  # noqa: PLC0415 - slow to load

    return cv2.transform(xyz.reshape(-1, 1, 3), matrix).reshape(xyz.shape)


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform `cam_from_world`: ``x_in_cam = R @ x_in_world + t``.

    R: (3, 3) float64 rotation; t: (3,) float64 in mesh units.
    """

    R: Array
    t: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", _frozen(self.R, (3, 3)))
        object.__setattr__(self, "t", _frozen(self.t, (3,)))

    @classmethod
    def identity(cls) -> Pose:
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def look_at(cls, center: ArrayLike, target: ArrayLike, up: ArrayLike = (0, 0, 1)) -> Pose:
        """A camera at `center` that looks at `target`, with world `up` upwards in the picture."""
        center = np.asarray(center, float)
        forward = np.asarray(target, float) - center
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, np.asarray(up, float))
        if np.linalg.norm(right) < 1e-9:
            right = np.cross(forward, np.roll(np.asarray(up, float), 1))
        right = right / np.linalg.norm(right)
        R = np.stack([right, np.cross(forward, right), forward])
        return cls(R, -R @ center)

    @property
    def center(self) -> Array:
        """(3,) position of the projection center, world."""
        return -self.R.T @ self.t

    @property
    def inverse(self) -> Pose:
        return Pose(self.R.T, self.center)

    def __matmul__(self, other: Pose) -> Pose:
        """``c_from_b @ b_from_a`` is ``c_from_a``."""
        return Pose(self.R @ other.R, self.R @ other.t + self.t)

    def apply(self, xyz: ArrayLike) -> Array:
        """(n, 3) points from the right-hand frame to the left-hand one."""
        xyz = np.asarray(xyz, np.float64)
        return _affine(xyz, np.concatenate([self.R, self.t[:, None]], axis=1))

    def step(self, delta: ArrayLike) -> Pose:
        """The pose moved by `delta` (6,): rotation vector (rad) then translation, both in cam axes.

        ``R' = expm([w]x) R``, ``t' = expm([w]x) t + v``.
        """
        import cv2  # noqa: PLC0415 - slow to load

        delta = np.asarray(delta, np.float64)
        dR = cv2.Rodrigues(delta[:3].reshape(3, 1))[0]
        return Pose(dR @ self.R, dR @ self.t + delta[3:])


@dataclass(frozen=True)
class Intrinsics:
    """Focal lengths, principal point and OpenCV distortion of a photo of `width` x `height` pixels.

    fx, fy, cx, cy in pixels; cx, cy count from the top-left corner of the image.
    dist: 0, 4, 5, 8, 12 or 14 coefficients in OpenCV's order (k1 k2 p1 p2 k3 ...); of a model
    "fisheye" 4 or 8 (see `texproj.fisheye`).
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    dist: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    model: LensModel = "perspective"

    def __post_init__(self) -> None:
        dist = tuple(float(k) for k in self.dist)
        if len(dist) not in LENGTHS[self.model]:
            raise ValueError(
                f"dist has {len(dist)} coefficients; {self.model} defines {LENGTHS[self.model]}"
            )
        object.__setattr__(self, "dist", dist)
        values = (self.fx, self.fy, self.cx, self.cy, *dist)
        if not np.isfinite(values).all() or min(self.fx, self.fy) <= 0:
            raise ValueError("intrinsics must be finite, with positive focal lengths")
        if min(self.width, self.height) < 1:
            raise ValueError("an image has at least one pixel")

    @classmethod
    def from_K(
        cls, K: ArrayLike, width: int, height: int, dist: ArrayLike = (0.0,) * 5
    ) -> Intrinsics:
        """From a 3 x 3 calibration matrix whose principal point counts from the image corner."""
        K = np.asarray(K, float).reshape(3, 3)
        coefficients = tuple(np.asarray(dist, float).ravel())
        return cls(width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2], coefficients)

    @property
    def K(self) -> Array:
        """(3, 3) calibration matrix, principal point from the image corner."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @property
    def distorted(self) -> bool:
        """Whether a pixel sees anything but ((x - cx) / fx, (y - cy) / fy)."""
        return self.is_fisheye or any(self.dist)

    @property
    def is_fisheye(self) -> bool:
        return self.model == "fisheye"

    @property
    def pinhole(self) -> Intrinsics:
        """The same without distortion."""
        return replace(self, dist=(0.0,) * 5, model="perspective")

    def resized(self, width: int, height: int) -> Intrinsics:
        """For the same photo resampled to `width` x `height` pixels."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self, width=width, height=height,
            fx=self.fx * sx, fy=self.fy * sy, cx=self.cx * sx, cy=self.cy * sy,
        )  # fmt: skip

    def scaled(self, factor: float) -> Intrinsics:
        """For the photo resampled by `factor`, sizes rounded to whole pixels."""
        return self.resized(max(1, round(self.width * factor)), max(1, round(self.height * factor)))

    @property
    def max_radius(self) -> float:
        """Largest undistorted radius (tangent of the off-axis angle) up to which the radial part
        of the lens model grows; beyond it the polynomial folds back and projections mean nothing.
        """
        return _max_radius(self.dist, self.is_fisheye)

    def distort(self, xy: ArrayLike) -> Array:
        """(n, 2) ideal normalized coordinates (x/z, y/z) to distorted normalized coordinates.

        NaN outside of `max_radius`.
        """
        xy = np.asarray(xy, np.float64).reshape(-1, 2)
        if not self.distorted:
            return xy.copy()
        return np.stack(self.distort_each(xy[:, 0], xy[:, 1]), axis=1)

    def distort_each(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """The same of x (n,) and y (n,) apart, of a lens that distorts: half of the time."""
        across, down = np.array(x, np.float64), np.array(y, np.float64)
        outside = ~(across * across + down * down < self.max_radius**2)
        some = bool(outside.any())
        if some:
            across[outside] = down[outside] = 0
        if self.is_fisheye or any(self.dist[12:]):
            bend = fisheye.distort if self.is_fisheye else _by_opencv
            across, down = bend(np.stack([across, down], axis=1), self.dist).T
        else:
            across, down = _by_polynomials(across, down, self.dist)
        if some:
            across[outside] = down[outside] = np.nan
        return across, down

    def undistort(self, xy: ArrayLike) -> Array:
        """(n, 2) distorted normalized coordinates to ideal ones; the inverse of `distort`.

        Damped Newton iteration. Domain: the image of the disk of `max_radius`; NaN outside of it.
        """
        target = np.asarray(xy, np.float64).reshape(-1, 2)
        if not self.distorted or not len(target):
            return target.copy()
        if self.is_fisheye:
            return fisheye.undistort(target, self.dist)
        limit = self.max_radius
        radius = np.linalg.norm(target, axis=1)
        guess = target * np.minimum(1, 0.9 * limit / np.maximum(radius, 1e-12))[:, None]
        error = np.linalg.norm(self.distort(guess) - target, axis=1)
        damping = np.ones(len(target))
        active = np.flatnonzero(np.isfinite(error))
        for _ in range(UNDISTORT_ITERATIONS):
            step = damping[active, None] * self._newton_step(guess[active], target[active])
            trial = guess[active] - step
            trial_error = np.linalg.norm(self.distort(trial) - target[active], axis=1)
            better = trial_error < error[active]
            guess[active[better]], error[active[better]] = trial[better], trial_error[better]
            damping[active] = np.where(
                better, np.minimum(1, 2 * damping[active]), damping[active] / 4
            )
            moving = np.abs(step).max(axis=1) > UNDISTORT_TOLERANCE
            active = active[moving & (error[active] > UNDISTORT_TOLERANCE / 10)]
            if not len(active):
                break
        guess[~(error < 1e-9)] = np.nan
        return guess

    def _newton_step(self, xy: Array, target: Array) -> Array:
        """(n, 2) solution of J step = distort(xy) - target, J by central differences."""
        h = 1e-6
        columns = [
            (self.distort(xy + offset) - self.distort(xy - offset)) / (2 * h)
            for offset in (np.array([h, 0.0]), np.array([0.0, h]))
        ]
        (a, c), (b, d) = columns[0].T, columns[1].T
        ex, ey = (self.distort(xy) - target).T
        det = a * d - b * c
        det = np.where(np.abs(det) < 1e-12, np.nan, det)
        return np.stack([(d * ex - b * ey) / det, (a * ey - c * ex) / det], axis=1)


def _by_opencv(xy: Array, dist: tuple[float, ...]) -> Array:
    """(n, 2) distorted coordinates, tilted sensors included."""
    if not len(xy):
        return xy
    import cv2  # noqa: PLC0415 - slow to load

    xyz, zero = np.concatenate([xy, np.ones((len(xy), 1))], axis=1), np.zeros(3)
    return cv2.projectPoints(xyz, zero, zero, np.eye(3), np.array(dist))[0].reshape(-1, 2)


@lru_cache(maxsize=256)
def _max_radius(dist: tuple[float, ...], is_fisheye: bool) -> float:
    """`Intrinsics.max_radius`, kept, since cameras of one lens are made by the thousand."""
    if max(map(abs, dist), default=0.0) > MOST_COEFFICIENT:
        return 0.0
    if is_fisheye:
        return float(np.tan(fisheye.limit_rad(dist)))
    k1, k2, _, _, k3, k4, k5, k6 = (*dist, *(0.0,) * 8)[:8]
    num = np.array([k3, k2, k1, 1.0])  # in r^2, highest power first
    den = np.array([k6, k5, k4, 1.0])
    for terms in (num, den):  # else the roots of what moves nothing overflow
        terms[:3][np.abs(terms[:3]) < NEGLIGIBLE_RADIAL] = 0
    # d/dr [r num/den] = 0, with s = r^2: (num + 2 s num') den - 2 s num den' = 0
    slope: Array = num + num * (6, 4, 2, 0)  # num + 2 s num'
    if den[:3].any():  # a solve asks this of each lens that it tries, and most have no such term
        slope = np.polysub(
            np.polymul(slope, den), np.polymul(np.polymul((2.0, 0.0), num), np.polyder(den))
        )
    roots = np.concatenate([np.roots(slope), np.roots(den)])
    limits = [r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 0]
    return float(np.sqrt(min(limits))) if limits else float("inf")


def _by_polynomials(x: Array, y: Array, dist: tuple[float, ...]) -> tuple[Array, Array]:
    """(n,) distorted coordinates by OpenCV's formula without tilt; twenty times as fast."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = (*dist, *(0.0,) * 12)[:12]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    if k4 or k5 or k6:
        radial /= 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    bent_x, bent_y = x * radial, y * radial
    if p1 or p2:
        bent_x += 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        bent_y += p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    if s1 or s2 or s3 or s4:
        bent_x += r2 * (s1 + r2 * s2)
        bent_y += r2 * (s3 + r2 * s4)
    return bent_x, bent_y


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics and pose of one photo."""

    intrinsics: Intrinsics
    pose: Pose

    @property
    def width(self) -> int:
        return self.intrinsics.width

    @property
    def height(self) -> int:
        return self.intrinsics.height

    @property
    def center(self) -> Array:
        """(3,) position of the projection center, world."""
        return self.pose.center

    def reduced(self, longest_px: float) -> Camera:
        """For the photo with its longer side reduced to `longest_px`, as it is if it is smaller."""
        return self.scaled(min(1.0, longest_px / max(self.width, self.height)))

    def scaled(self, factor: float) -> Camera:
        return replace(self, intrinsics=self.intrinsics.scaled(factor))

    def resized(self, width: int, height: int) -> Camera:
        return replace(self, intrinsics=self.intrinsics.resized(width, height))

    def project(self, xyz_in_world: ArrayLike) -> tuple[Array, Array]:
        """(n, 3) points to ((n, 2) pixels, (n,) depth along the optical axis in mesh units).

        Pixels are NaN behind the camera and outside the domain of the lens model.
        """
        xyz = self.pose.apply(np.asarray(xyz_in_world, np.float64).reshape(-1, 3))
        depth = xyz[:, 2]
        front = depth > 0
        ideal = np.full((len(xyz), 2), np.nan)
        ideal[front] = xyz[front, :2] / depth[front, None]
        k = self.intrinsics
        xy = np.full_like(ideal, np.nan)
        xy[front] = k.distort(ideal[front])
        return xy * (k.fx, k.fy) + (k.cx, k.cy), depth

    def inside(self, xy_px: ArrayLike) -> NDArray[np.bool_]:
        """(n,) whether pixels lie in the picture; NaN does not."""
        xy = np.asarray(xy_px, np.float64)
        return np.all((xy >= 0) & (xy < (self.width, self.height)), axis=-1)

    def unproject(self, xy_px: ArrayLike, depth: ArrayLike) -> Array:
        """(n, 2) pixels and (n,) depths along the optical axis to (n, 3) world points."""
        ideal = self._ideal(xy_px)
        z = np.broadcast_to(np.asarray(depth, np.float64), len(ideal))[:, None]
        return self.pose.inverse.apply(np.concatenate([ideal * z, z], axis=1))

    def rays(self, xy_px: ArrayLike) -> tuple[Array, Array]:
        """(n, 2) pixels to the ((n, 3) origins, (n, 3) unit directions) that they see, world."""
        ideal = self._ideal(xy_px)
        in_cam = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
        directions = Pose(self.pose.R.T, np.zeros(3)).apply(in_cam)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return np.broadcast_to(self.center, directions.shape).copy(), directions

    def _ideal(self, xy_px: ArrayLike) -> Array:
        k = self.intrinsics
        xy = np.asarray(xy_px, np.float64).reshape(-1, 2)
        return k.undistort((xy - (k.cx, k.cy)) / (k.fx, k.fy))
