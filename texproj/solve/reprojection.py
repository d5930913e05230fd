"""Reprojection error of 3D-2D pairs as a least-squares problem over pose and lens.

Parameters: rotation (3, rad) and translation (3, mesh units) in camera axes as `Pose.step`,
then the intrinsics named in `free`. Coefficients that are not free stay in the model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera, Intrinsics

DISTORTION_NAMES = ("k1", "k2", "p1", "p2", "k3")
FISHEYE_NAMES = ("k1", "k2", "k3", "k4", "p1", "p2")
DIFFERENCE = 1e-6
"""Step of central differences: of ideal coordinates, logarithms, pixels and coefficients."""
INTRINSIC_NAMES = ("focal", "aspect", "cx", "cy", *DISTORTION_NAMES)
"""focal: log of fx and fy together; aspect: log of fy / fx at fixed fx; cx, cy: pixels."""


@dataclass(frozen=True)
class Prior:
    """What is known of one intrinsic: its value (focal: log pixels) and standard deviation."""

    name: str
    value: float
    sigma: float


@dataclass(frozen=True, eq=False)
class Reprojection:
    """The problem of a camera whose projections of points shall meet their pixels.

    xy_px: (n, 2); xyz_in_world: (n, 3); sigma_px: noise of xy_px, by which residuals are
    divided; free: intrinsics to solve; priors: on any of them.
    """

    xy_px: Doubles
    xyz_in_world: Doubles
    sigma_px: float = 1.0
    free: tuple[str, ...] = ()
    priors: tuple[Prior, ...] = ()

    def residual(self, camera: Camera) -> Doubles:
        """(n, 2) projected minus picked position over sigma; NaN where it does not project."""
        return (camera.project(self.xyz_in_world)[0] - self.xy_px) / self.sigma_px

    def jacobian(self, camera: Camera) -> Doubles:
        """(n, 2, 6 + len(free)) derivative of the residual."""
        return projection_jacobian(camera, self.xyz_in_world, self.free) / self.sigma_px

    def step(self, camera: Camera, delta: Doubles) -> Camera:
        intrinsics = camera.intrinsics
        for name, change in zip(self.free, delta[6:], strict=True):
            intrinsics = intrinsic_step(intrinsics, name, change)
        return Camera(intrinsics, camera.pose.step(delta[:6]))

    def prior(self, camera: Camera) -> tuple[Doubles, Doubles]:
        """((q,), (q, p)) of the priors on what is free."""
        used = [p for p in self.priors if p.name in self.free]
        value = [(intrinsic_value(camera.intrinsics, p.name) - p.value) / p.sigma for p in used]
        jacobian = np.zeros((len(used), 6 + len(self.free)))
        for row, p in enumerate(used):
            jacobian[row, 6 + self.free.index(p.name)] = 1 / p.sigma
        return np.array(value), jacobian


def projection_jacobian(
    camera: Camera, xyz_in_world: Doubles, free: tuple[str, ...] = ()
) -> Doubles:
    """(n, 2, 6 + len(free)) derivative of the pixels by `Reprojection.step`, zero if behind.

    OpenCV's analytic derivatives, taken at the identity pose in camera coordinates, where its
    rotation vector is the left-multiplied one of `Pose.step`.
    """
    if not len(xyz_in_world):  # OpenCV gives None
        return np.zeros((0, 2, 6 + len(free)))
    k = camera.intrinsics
    xyz = camera.pose.apply(xyz_in_world)
    behind = ~(xyz[:, 2] > 0)
    xyz[behind] = (0, 0, 1)
    if k.is_fisheye:
        out = _fisheye_jacobian(k, xyz, free)
        out[behind | ~np.isfinite(out).all(axis=(1, 2))] = 0
        return out
    dist = np.zeros(max(5, len(k.dist)))
    dist[: len(k.dist)] = k.dist
    zero = np.zeros(3)
    every = cv2.projectPoints(xyz, zero, zero, k.K, dist)[1].reshape(len(xyz), 2, -1)
    columns = [every[:, :, :6]] + [_intrinsic_column(every, k, name)[..., None] for name in free]
    out = np.concatenate(columns, axis=2)
    out[behind] = 0
    return out


def _fisheye_jacobian(k: Intrinsics, xyz: Doubles, free: tuple[str, ...]) -> Doubles:
    """The same of a fisheye for points in camera axes: the lens by central differences."""
    ideal, scale = xyz[:, :2] / xyz[:, 2:], np.array([k.fx, k.fy])
    steps = np.eye(2) * DIFFERENCE
    of_ideal = np.stack(
        [(k.distort(ideal + s) - k.distort(ideal - s)) / (2 * DIFFERENCE) for s in steps], axis=-1
    )
    x, y, z = xyz.T
    zero = np.zeros(len(xyz))
    of_xyz = np.stack([
        np.stack([1 / z, zero, -x / z**2], axis=1), np.stack([zero, 1 / z, -y / z**2], axis=1),
    ], axis=1)  # fmt: skip
    turned = np.stack([
        np.stack([zero, z, -y], axis=1), np.stack([-z, zero, x], axis=1),
        np.stack([y, -x, zero], axis=1),
    ], axis=1)  # fmt: skip
    moved = scale[:, None] * np.einsum("nij,njk->nik", of_ideal, of_xyz)
    pose = [np.einsum("nij,njk->nik", moved, turned), moved]

    def pixels(lens: Intrinsics) -> Doubles:
        return lens.distort(ideal) * (lens.fx, lens.fy) + (lens.cx, lens.cy)

    for name in free:
        ends = [pixels(intrinsic_step(k, name, sign * DIFFERENCE)) for sign in (1, -1)]
        pose.append(((ends[0] - ends[1]) / (2 * DIFFERENCE))[..., None])
    return np.concatenate(pose, axis=2)


def displacement_variance(jacobian: Doubles, covariance: Doubles) -> Doubles:
    """(n,) variance, px^2, of the length of the displacement of points whose (n, 2, p) derivative
    this is, under the (p, p) covariance; infinite where that says nothing.
    """
    if not np.isfinite(covariance).all():
        return np.full(len(jacobian), np.inf)
    return np.einsum("nip,pq,niq->n", jacobian, covariance, jacobian)


def _intrinsic_column(every: Doubles, k: Intrinsics, name: str) -> Doubles:
    """(n, 2); OpenCV's columns are rotation, translation, fx, fy, cx, cy, distortion."""
    if name == "focal":
        return k.fx * every[:, :, 6] + k.fy * every[:, :, 7]
    if name == "aspect":
        return k.fy * every[:, :, 7]
    if name in ("cx", "cy"):
        return every[:, :, 8 + (name == "cy")]
    return every[:, :, 10 + DISTORTION_NAMES.index(name)]


def intrinsic_value(k: Intrinsics, name: str) -> float:
    """The parameter `name` of `INTRINSIC_NAMES` as the solver sees it."""
    if name == "focal":
        return float(np.log(k.fx))
    if name == "aspect":
        return float(np.log(k.fy / k.fx))
    if name in ("cx", "cy"):
        return k.cx if name == "cx" else k.cy
    return (*k.dist, *(0.0,) * 5)[_place(k, name)]


def _place(k: Intrinsics, name: str) -> int:
    """Where a coefficient stands in `dist`."""
    return (FISHEYE_NAMES if k.is_fisheye else DISTORTION_NAMES).index(name)


def intrinsic_step(k: Intrinsics, name: str, change: float) -> Intrinsics:
    """`k` with the parameter `name` moved by `change`."""
    change = float(change)
    if name == "focal":
        factor = float(np.exp(np.clip(change, -1, 1)))
        return replace(k, fx=k.fx * factor, fy=k.fy * factor)
    if name == "aspect":
        return replace(k, fy=k.fy * float(np.exp(np.clip(change, -1, 1))))
    if name == "cx":
        return replace(k, cx=k.cx + change)
    if name == "cy":
        return replace(k, cy=k.cy + change)
    dist = np.zeros(8 if k.is_fisheye else max(5, len(k.dist)))
    dist[: len(k.dist)] = k.dist
    dist[_place(k, name)] += change
    return replace(k, dist=tuple(dist))
