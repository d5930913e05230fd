"""All cameras at once: ties between photos through the surface as a sparse least-squares problem.

A tie says that the surface point which camera j sees at one pixel appears in camera i at
another. The point moves with camera j: its ray is cut with the plane that touches the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from texproj.camera import Camera
from texproj.solve.reprojection import projection_jacobian

Array = NDArray[np.float64]
Cameras = tuple[Camera, ...]


@dataclass(frozen=True, eq=False)
class Ties:
    """n ties. to, source: (n,) numbers of the cameras i and j; to_px: (n, 2) where the point is
    seen in i; ray_in_source: (n, 3) its ray in the axes of camera j; point, normal: (n, 3) world,
    the plane that touches the surface there.
    """

    to: NDArray[np.intp]
    source: NDArray[np.intp]
    to_px: Array
    ray_in_source: Array
    point: Array
    normal: Array

    def __len__(self) -> int:
        return len(self.to)

    def at(self, where: NDArray[np.bool_]) -> Ties:
        """The chosen ties alone."""
        return Ties(*(getattr(self, name)[where] for name in self.__dataclass_fields__))

    @classmethod
    def joined(cls, parts: Sequence[Ties]) -> Ties:
        """All ties of several sets."""
        names = cls.__dataclass_fields__
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


@dataclass(frozen=True, eq=False)
class Anchors:
    """What each camera's own registration says: pixels at which it saw some surface points.

    camera: (m,) numbers; point: (m, 3) world; px: (m, 2); sigma_px: (m,) standard deviation,
    already widened for the points of one camera are not independent.
    """

    camera: NDArray[np.intp]
    point: Array
    px: Array
    sigma_px: Array


@dataclass(frozen=True, eq=False)
class JointPoses:
    """Poses of all cameras from ties and anchors; the variable is a tuple of cameras.

    sigma_px: noise of the ties; fixed: (cameras,) bool, whose poses are not solved.
    """

    ties: Ties
    anchors: Anchors
    sigma_px: float
    fixed: NDArray[np.bool_]

    def residual(self, cameras: Cameras) -> Array:
        """(n, 2) seen minus measured position in camera i, over sigma; NaN where not seen."""
        xyz = self.points(cameras)
        out = np.full((len(self.ties), 2), np.nan)
        for i in np.unique(self.ties.to):
            rows = self.ties.to == i
            out[rows] = cameras[i].project(xyz[rows])[0] - self.ties.to_px[rows]
        return out / self.sigma_px

    def points(self, cameras: Cameras) -> Array:
        """(n, 3) where the ties' rays meet the surface, world."""
        ties = self.ties
        out = np.empty((len(ties), 3))
        for j in np.unique(ties.source):
            rows = ties.source == j
            pose = cameras[j].pose
            ray = ties.ray_in_source[rows] @ pose.R
            gap = ((ties.point[rows] - pose.center) * ties.normal[rows]).sum(1)
            out[rows] = pose.center + ray * (gap / (ties.normal[rows] * ray).sum(1))[:, None]
        return out

    def jacobian(self, cameras: Cameras) -> sparse.csr_matrix:
        """(2 n, 6 cameras) derivative of the residual by the poses' steps."""
        xyz = self.points(cameras)
        own, other = np.zeros((len(self.ties), 2, 6)), np.zeros((len(self.ties), 2, 6))
        for i in np.unique(self.ties.to):
            rows = self.ties.to == i
            own[rows] = projection_jacobian(cameras[i], xyz[rows])
        for i, j in np.unique(np.stack([self.ties.to, self.ties.source], axis=1), axis=0):
            rows = (self.ties.to == i) & (self.ties.source == j)
            by_point = own[rows][:, :, 3:] @ cameras[i].pose.R
            other[rows] = by_point @ self._point_jacobian(cameras[j], xyz[rows], rows)
        return self._assembled(own / self.sigma_px, other / self.sigma_px, len(cameras))

    def step(self, cameras: Cameras, delta: Array) -> Cameras:
        """Each pose moved by its six numbers."""
        moves = delta.reshape(-1, 6)
        return tuple(
            c if self.fixed[k] else Camera(c.intrinsics, c.pose.step(moves[k]))
            for k, c in enumerate(cameras)
        )

    def prior(self, cameras: Cameras) -> tuple[Array, sparse.csr_matrix]:
        """The anchors, and a unit hold on cameras that are fixed."""
        anchors, count = self.anchors, len(cameras)
        residual = np.zeros((len(anchors.camera), 2))
        jacobian = np.zeros((len(anchors.camera), 2, 6))
        for k in np.unique(anchors.camera):
            rows = anchors.camera == k
            sigma = anchors.sigma_px[rows, None]
            residual[rows] = (cameras[k].project(anchors.point[rows])[0] - anchors.px[rows]) / sigma
            jacobian[rows] = projection_jacobian(cameras[k], anchors.point[rows]) / sigma[..., None]
        known = np.isfinite(residual).all(axis=1)
        residual, jacobian = residual[known], jacobian[known]
        held = np.repeat(self.fixed, 6).astype(float)
        matrix = _scattered(jacobian, anchors.camera[known], count)
        whole: sparse.csr_matrix = sparse.vstack([matrix, sparse.diags(held)], format="csr")
        return np.concatenate([residual.ravel(), np.zeros(6 * count)]), whole

    def _point_jacobian(self, camera: Camera, xyz: Array, rows: NDArray[np.bool_]) -> Array:
        """(k, 3, 6) how the surface point moves with the pose of the camera whose ray it is on."""
        R = camera.pose.R
        in_cam = camera.pose.apply(xyz)
        rigid = np.concatenate(
            [R.T @ _cross_matrices(in_cam), -np.broadcast_to(R.T, (len(xyz), 3, 3))], axis=2
        )
        ray = xyz - camera.center
        normal = self.ties.normal[rows]
        along = ray / (normal * ray).sum(1, keepdims=True)
        out: Array = rigid - along[:, :, None] * (normal[:, None] @ rigid)
        return out

    def _assembled(self, own: Array, other: Array, count: int) -> sparse.csr_matrix:
        free = ~self.fixed
        own = own * free[self.ties.to][:, None, None]
        other = other * free[self.ties.source][:, None, None]
        return _scattered(own, self.ties.to, count) + _scattered(other, self.ties.source, count)


def _cross_matrices(v: Array) -> Array:
    """(n, 3, 3) matrices C with ``C @ w = v x w``."""
    out = np.zeros((len(v), 3, 3))
    out[:, 0, 1], out[:, 0, 2] = -v[:, 2], v[:, 1]
    out[:, 1, 0], out[:, 1, 2] = v[:, 2], -v[:, 0]
    out[:, 2, 0], out[:, 2, 1] = -v[:, 1], v[:, 0]
    return out


def _scattered(blocks: Array, camera: NDArray[np.intp], count: int) -> sparse.csr_matrix:
    """(2 n, 6 count) sparse matrix of (n, 2, 6) blocks, each in the columns of its camera."""
    n = len(blocks)
    rows = np.repeat(np.arange(2 * n), 6)
    columns = np.repeat(camera * 6, 12) + np.tile(np.arange(6), 2 * n)
    return sparse.csr_matrix((blocks.ravel(), (rows, columns)), shape=(2 * n, 6 * count))
