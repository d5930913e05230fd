"""All cameras at once: ties between photos through the surface as a sparse least-squares problem.

A tie says that the surface point which camera j sees at one pixel appears in camera i at
another. The point moves with camera j: its ray is cut with the plane that touches the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from texproj.arrays import Doubles
from texproj.camera import Camera, Intrinsics
from texproj.solve.reprojection import projection_jacobian

Cameras = tuple[Camera, ...]


@dataclass(frozen=True, eq=False)
class Ties:
    """n ties. to, source: (n,) numbers of the cameras i and j; to_px: (n, 2) where the point is
    seen in i; ideal_in_source: (n, 2) x/z and y/z of its ray in camera j, focal_in_source: (n,) at
    the focal length fx in pixels that j had then; point, normal: (n, 3) world, the plane that
    touches the surface there.
    """

    to: NDArray[np.intp]
    source: NDArray[np.intp]
    to_px: Doubles
    ideal_in_source: Doubles
    focal_in_source: Doubles
    point: Doubles
    normal: Doubles

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
    point: Doubles
    px: Doubles
    sigma_px: Doubles


@dataclass(frozen=True, eq=False)
class Lenses:
    """Which cameras share a focal length. group: (cameras,) numbers; log_focal: (groups,) what is
    known of log fx beforehand, sigma: its standard deviation; free: (groups,) bool, is it solved.
    """

    group: NDArray[np.intp]
    log_focal: Doubles
    sigma: float
    free: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class JointPoses:
    """All poses and shared focal lengths from ties and anchors; the variable is a tuple of cameras,
    its step six numbers a camera, as `Pose.step`, then the change of log focal of each group.

    sigma_px: (cameras,) noise of the ties found in each photo; fixed: (cameras,) bool, whose poses
    are not solved.
    """

    ties: Ties
    anchors: Anchors
    lenses: Lenses
    sigma_px: Doubles
    fixed: NDArray[np.bool_]

    def residual(self, cameras: Cameras) -> Doubles:
        """(n, 2) seen minus measured position in camera i, over sigma; NaN where not seen."""
        xyz = self.points(cameras)
        out = np.full((len(self.ties), 2), np.nan)
        for i in np.unique(self.ties.to):
            rows = self.ties.to == i
            out[rows] = cameras[i].project(xyz[rows])[0] - self.ties.to_px[rows]
        return out / self.sigma_px[self.ties.to, None]

    def points(self, cameras: Cameras) -> Doubles:
        """(n, 3) where the ties' rays meet the surface, world."""
        out = np.empty((len(self.ties), 3))
        for j in np.unique(self.ties.source):
            rows = self.ties.source == j
            out[rows] = self._met(cameras[j], rows)[0]
        return out

    def jacobian(self, cameras: Cameras) -> sparse.csr_matrix:
        """(2 n, 6 cameras + groups) derivative of the residual by the step."""
        n = len(self.ties)
        own, other = np.zeros((n, 2, 7)), np.zeros((n, 2, 7))
        xyz = self.points(cameras)
        for i in np.unique(self.ties.to):
            rows = self.ties.to == i
            own[rows] = projection_jacobian(cameras[i], xyz[rows], ("focal",))
        for i, j in np.unique(np.stack([self.ties.to, self.ties.source], axis=1), axis=0):
            rows = (self.ties.to == i) & (self.ties.source == j)
            by_point = own[rows][:, :, 3:6] @ cameras[i].pose.R
            other[rows] = by_point @ self._point_jacobian(cameras[j], rows)
        whole = self._scattered(own, self.ties.to) + self._scattered(other, self.ties.source)
        weight = np.repeat(1 / self.sigma_px[self.ties.to], 2)
        return sparse.csr_matrix(sparse.diags(weight) @ whole)

    def step(self, cameras: Cameras, delta: Doubles) -> Cameras:
        """Each pose moved by its six numbers, each focal length scaled."""
        count = len(cameras)
        moves, scale = delta[: 6 * count].reshape(-1, 6), np.exp(np.clip(delta[6 * count :], -1, 1))
        return tuple(
            Camera(
                scaled_focal(c.intrinsics, float(scale[self.lenses.group[k]])),
                c.pose if self.fixed[k] else c.pose.step(moves[k]),
            )
            for k, c in enumerate(cameras)
        )

    def prior(self, cameras: Cameras) -> tuple[Doubles, sparse.csr_matrix]:
        """The anchors, what is known of the focal lengths, and a unit hold on what is fixed."""
        anchors = self.anchors
        residual = np.zeros((len(anchors.camera), 2))
        jacobian = np.zeros((len(anchors.camera), 2, 7))
        for k in np.unique(anchors.camera):
            rows = anchors.camera == k
            sigma = anchors.sigma_px[rows, None]
            seen = cameras[k].project(anchors.point[rows])[0]
            residual[rows] = (seen - anchors.px[rows]) / sigma
            columns = projection_jacobian(cameras[k], anchors.point[rows], ("focal",))
            jacobian[rows] = columns / sigma[..., None]
        known = np.isfinite(residual).all(axis=1)
        matrix = self._scattered(jacobian[known], anchors.camera[known])
        hold, held = self._holds(cameras)
        whole = sparse.vstack([matrix, hold], format="csr")
        return np.concatenate([residual[known].ravel(), held]), whole

    def _holds(self, cameras: Cameras) -> tuple[sparse.csr_matrix, Doubles]:
        """A row for each parameter: the focal lengths' prior, one for what must not move."""
        lenses = self.lenses
        first = [int(np.flatnonzero(lenses.group == g)[0]) for g in range(len(lenses.log_focal))]
        log_focal = np.log([cameras[k].intrinsics.fx for k in first])
        sigma = np.where(lenses.free, lenses.sigma, 1.0)
        value = np.where(lenses.free, (log_focal - lenses.log_focal) / sigma, 0)
        weight = np.concatenate([np.repeat(self.fixed, 6).astype(float), 1 / sigma])
        return sparse.csr_matrix(sparse.diags(weight)), np.concatenate(
            [np.zeros(6 * len(cameras)), value]
        )

    def _met(self, camera: Camera, rows: NDArray[np.bool_]) -> tuple[Doubles, Doubles, Doubles]:
        """(k, 3) where the rays of `rows` meet the surface; the rays in cam; how far along."""
        scale = self.ties.focal_in_source[rows] / camera.intrinsics.fx
        ideal = self.ties.ideal_in_source[rows] * scale[:, None]
        in_cam = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
        ray = in_cam @ camera.pose.R
        normal = self.ties.normal[rows]
        gap = ((self.ties.point[rows] - camera.center) * normal).sum(1)
        along = gap / (normal * ray).sum(1)
        return camera.center + ray * along[:, None], in_cam, along

    def _point_jacobian(self, camera: Camera, rows: NDArray[np.bool_]) -> Doubles:
        """(k, 3, 7) how the surface point moves with the pose and the focal length of the camera
        whose ray it is on.
        """
        R = camera.pose.R
        xyz, in_cam, along = self._met(camera, rows)
        turn = R.T @ _cross_matrices(camera.pose.apply(xyz))
        shift = -np.broadcast_to(R.T, (len(xyz), 3, 3))
        zoom = (-in_cam * (1, 1, 0) * along[:, None]) @ R
        free = np.concatenate([turn, shift, zoom[:, :, None]], axis=2)
        ray, normal = xyz - camera.center, self.ties.normal[rows]
        slide = ray / (normal * ray).sum(1, keepdims=True)
        out: Doubles = free - slide[:, :, None] * (normal[:, None] @ free)
        return out

    def _scattered(self, blocks: Doubles, camera: NDArray[np.intp]) -> sparse.csr_matrix:
        """(2 n, parameters) sparse matrix of (n, 2, 7) blocks, in the columns of their cameras and
        lenses; what is fixed stays zero.
        """
        n, group, lenses = len(blocks), self.lenses.group[camera], self.lenses
        free = np.repeat(~self.fixed[camera][:, None], 6, axis=1)
        free = np.concatenate([free, lenses.free[group][:, None]], axis=1)
        columns = camera[:, None] * 6 + np.arange(6)
        columns = np.concatenate([columns, 6 * len(self.fixed) + group[:, None]], axis=1)
        rows = np.repeat(np.arange(2 * n), 7)
        columns = np.repeat(columns[:, None], 2, axis=1)
        shape = (2 * n, 6 * len(self.fixed) + len(lenses.log_focal))
        return sparse.csr_matrix(((blocks * free[:, None]).ravel(), (rows, columns.ravel())), shape)


def scaled_focal(k: Intrinsics, factor: float) -> Intrinsics:
    """`k` with both focal lengths times `factor`."""
    return replace(k, fx=k.fx * factor, fy=k.fy * factor)


def _cross_matrices(v: Doubles) -> Doubles:
    """(n, 3, 3) matrices C with ``C @ w = v x w``."""
    out = np.zeros((len(v), 3, 3))
    out[:, 0, 1], out[:, 0, 2] = -v[:, 2], v[:, 1]
    out[:, 1, 0], out[:, 1, 2] = v[:, 2], -v[:, 0]
    out[:, 2, 0], out[:, 2, 1] = -v[:, 1], v[:, 0]
    return out
