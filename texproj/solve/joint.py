"""All cameras at once: ties between photos through the surface as a sparse least-squares problem.

A tie says that the surface point which camera j sees at one pixel appears in camera i at
another. The point moves with camera j: its ray is cut with the plane that touches the surface.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from texproj.arrays import Bools, Doubles, Index
from texproj.camera import Camera
from texproj.solve.lm import JacobianPart
from texproj.solve.reprojection import projection_jacobian
from texproj.solve.shared_lens import LensParameters, ideal_of

Cameras = tuple[Camera, ...]


@dataclass(frozen=True, eq=False)
class Ties:
    """n ties. to, source: (n,) numbers of the cameras i and j; to_px, source_px: (n, 2) where the
    point is seen in each; ideal_in_source: (n, 2) x/z and y/z of its ray in camera j, with the lens
    that j had then; point, normal: (n, 3) world, the plane that touches the surface there.
    """

    to: Index
    source: Index
    to_px: Doubles
    source_px: Doubles
    ideal_in_source: Doubles
    point: Doubles
    normal: Doubles

    def __len__(self) -> int:
        return len(self.to)

    def at(self, where: Bools) -> Ties:
        """The chosen ties alone."""
        return Ties(*(getattr(self, name)[where] for name in self.__dataclass_fields__))

    @classmethod
    def none(cls) -> Ties:
        """No tie at all."""
        number, pixel, point = np.zeros(0, np.intp), np.zeros((0, 2)), np.zeros((0, 3))
        return cls(number, number, pixel, pixel, pixel, point, point)

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

    camera: Index
    point: Doubles
    px: Doubles
    sigma_px: Doubles


@dataclass(frozen=True, eq=False)
class JointPoses:
    """All poses and shared intrinsics from ties and anchors; the variable is a tuple of cameras,
    its step six numbers a camera, as `Pose.step`, then those of `lenses`.

    sigma_px: (cameras,) noise of the ties found in each photo; fixed: (cameras,) bool, whose poses
    are not solved.
    """

    ties: Ties
    anchors: Anchors
    lenses: LensParameters
    sigma_px: Doubles
    fixed: Bools

    def residual(self, cameras: Cameras) -> Doubles:
        """(n, 2) seen minus measured position in camera i, over sigma; NaN where not seen."""
        xyz, out = self.points(cameras), np.empty((len(self.ties), 2))
        for i, rows in self._by_to:
            out[rows] = cameras[i].project(xyz[rows])[0] - self.ties.to_px[rows]
        return out / self.sigma_px[self.ties.to, None]

    def points(self, cameras: Cameras) -> Doubles:
        """(n, 3) where the ties' rays meet the surface, world."""
        out = np.empty((len(self.ties), 3))
        for j, rows in self._by_source:
            out[rows] = self._met(cameras[j], rows)
        return out

    def jacobian(self, cameras: Cameras) -> Iterator[JacobianPart]:
        """Of one pair of cameras after the other: how the residuals of its ties move with the poses
        and lenses of both.
        """
        for j, rows in self._by_source:
            moving = self._moving(cameras[j], rows)
            for i, chosen in _grouped(self.ties.to[rows]):
                own = projection_jacobian(cameras[i], moving.xyz[chosen], self.lenses.names)
                own /= self.sigma_px[i]
                other = moving.at(chosen).jacobian(_turned(own[:, :, 3:6], cameras[i].pose.R))
                own[:, :, self._held[i]] = other[:, :, self._held[j]] = 0
                columns = np.concatenate([self._columns[i], self._columns[j]])
                yield JacobianPart(rows[chosen], columns, np.concatenate([own, other], axis=2))

    @cached_property
    def _columns(self) -> Index:
        """(cameras, 6 + names) numbers of the parameters of each camera."""
        poses = 6 * np.arange(len(self.fixed))[:, None] + np.arange(6)
        return np.concatenate([poses, 6 * len(self.fixed) + self.lenses.columns], axis=1)

    @cached_property
    def _held(self) -> Bools:
        """(cameras, 6 + names) which of these are not solved."""
        poses = np.repeat(self.fixed[:, None], 6, axis=1)
        return np.concatenate([poses, ~self.lenses.free[self.lenses.columns]], axis=1)

    @cached_property
    def _by_to(self) -> list[tuple[int, Index]]:
        return _grouped(self.ties.to)

    @cached_property
    def _by_source(self) -> list[tuple[int, Index]]:
        return _grouped(self.ties.source)

    def step(self, cameras: Cameras, delta: Doubles) -> Cameras:
        """Each pose moved by its six numbers, each lens by its own."""
        count = len(cameras)
        moves, change = delta[: 6 * count].reshape(-1, 6), delta[6 * count :]
        return tuple(
            Camera(
                self.lenses.step(k, c.intrinsics, change),
                c.pose if self.fixed[k] else c.pose.step(moves[k]),
            )
            for k, c in enumerate(cameras)
        )

    def prior(self, cameras: Cameras) -> tuple[Doubles, sparse.csr_matrix]:
        """The anchors, what is known of the lenses, and a unit hold on what is fixed."""
        anchors, names = self.anchors, self.lenses.names
        residual = np.zeros((len(anchors.camera), 2))
        jacobian = np.zeros((len(anchors.camera), 2, 6 + len(names)))
        for k in np.unique(anchors.camera):
            rows = anchors.camera == k
            sigma = anchors.sigma_px[rows, None]
            seen = cameras[k].project(anchors.point[rows])[0]
            residual[rows] = (seen - anchors.px[rows]) / sigma
            columns = projection_jacobian(cameras[k], anchors.point[rows], names)
            jacobian[rows] = columns / sigma[..., None]
        known = np.isfinite(residual).all(axis=1)
        matrix = self._scattered(jacobian[known], anchors.camera[known])
        hold, held = self._holds(cameras)
        whole = sparse.vstack([matrix, hold], format="csr")
        return np.concatenate([residual[known].ravel(), held]), whole

    def _holds(self, cameras: Cameras) -> tuple[sparse.csr_matrix, Doubles]:
        """A row for each parameter: the prior of each intrinsic, one for what must not move."""
        value, weight = self.lenses.prior(cameras)
        weight = np.concatenate([np.repeat(self.fixed, 6).astype(float), weight])
        held = np.concatenate([np.zeros(6 * len(cameras)), value])
        return sparse.csr_matrix(sparse.diags(weight)), held

    def _met(self, camera: Camera, rows: Index) -> Doubles:
        """(k, 3) where the rays of `rows` meet the surface, world."""
        px, guess = self.ties.source_px[rows], self.ties.ideal_in_source[rows]
        ideal = ideal_of(camera.intrinsics, px, guess)
        in_cam = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
        ray = in_cam @ camera.pose.R
        normal = self.ties.normal[rows]
        gap = ((self.ties.point[rows] - camera.center) * normal).sum(1)
        along = gap / (normal * ray).sum(1)
        out: Doubles = camera.center + ray * along[:, None]
        return out

    def _moving(self, camera: Camera, rows: Index) -> _MovingPoints:
        """How the surface points of `rows` move with the camera whose rays they are on."""
        xyz = self._met(camera, rows)
        ray, normal = xyz - camera.center, self.ties.normal[rows]
        slide = ray / (normal * ray).sum(1, keepdims=True)
        at = projection_jacobian(camera, xyz, self.lenses.names)
        (a, b), (c, d) = np.moveaxis(at[:, :, 3:5], 0, -1)
        across, down = at[:, 0, 6:].T, at[:, 1, 6:].T
        aside = np.stack([b * down - d * across, c * across - a * down]) / (a * d - b * c)
        pose = camera.pose
        return _MovingPoints(xyz, pose.apply(xyz), normal, slide, aside.transpose(2, 0, 1), pose.R)

    def _scattered(self, blocks: Doubles, camera: Index) -> sparse.csr_matrix:
        """(2 n, parameters) sparse matrix of (n, 2, 6 + names) blocks, in the columns of their
        cameras and lenses; what is fixed stays zero.
        """
        n, width = len(blocks), blocks.shape[2]
        indices = np.repeat(self._columns[camera].astype(np.int32)[:, None], 2, axis=1).ravel()
        starts = np.arange(0, 2 * n * width + 1, width, dtype=np.int32)
        shape = (2 * n, 6 * len(self.fixed) + self.lenses.count)
        values = np.where(self._held[camera][:, None], 0, blocks)
        return sparse.csr_matrix((values.ravel(), indices, starts), shape)


def _grouped(numbers: Index) -> list[tuple[int, Index]]:
    """Each number that occurs, and where."""
    order = np.argsort(numbers, kind="stable")
    values, starts = np.unique(numbers[order], return_index=True)
    parts = np.split(order, starts[1:]) if len(values) else []
    return list(zip(values.tolist(), parts, strict=True))


@dataclass(frozen=True, eq=False)
class _MovingPoints:
    """Surface points that move with pose and lens of a camera, since their pixels stay.

    xyz: (k, 3) world; in_cam: (k, 3) the same in its axes; normal: (k, 3) of the planes that they
    stay on, world; slide: (k, 3) along their rays, of unit length along the normal; aside:
    (k, 2, names) how ideal coordinates move with the lens, times depth; R: (3, 3) of the camera.
    """

    xyz: Doubles
    in_cam: Doubles
    normal: Doubles
    slide: Doubles
    aside: Doubles
    R: Doubles

    def at(self, which: Index) -> _MovingPoints:
        """Some of them."""
        return replace(
            self, xyz=self.xyz[which], in_cam=self.in_cam[which], normal=self.normal[which],
            slide=self.slide[which], aside=self.aside[which],
        )  # fmt: skip

    def jacobian(self, by_point: Doubles) -> Doubles:
        """(k, 2, 6 + names) derivative by the camera's own parameters of what moves with the points
        as `by_point` (k, 2, 3), world, says.
        """
        along = (by_point * self.slide[:, None]).sum(2, keepdims=True)
        g = _turned(by_point - along * self.normal[:, None], self.R.T)
        out = np.empty((len(g), 2, 6 + self.aside.shape[2]))
        (gx, gy, gz), (x, y, z) = np.moveaxis(g, -1, 0), self.in_cam.T[..., None]
        out[:, :, 0] = gy * z - gz * y  # a turn moves them by the cross product
        out[:, :, 1] = gz * x - gx * z
        out[:, :, 2] = gx * y - gy * x
        np.negative(g, out=out[:, :, 3:6])
        out[:, :, 6:] = g[:, :, :1] * self.aside[:, :1] + g[:, :, 1:2] * self.aside[:, 1:]
        return out


def _turned(rows: Doubles, R: Doubles) -> Doubles:
    """(k, 2, 3) row vectors times R (3, 3), in one product."""
    out: Doubles = (rows.reshape(-1, 3) @ R).reshape(rows.shape)
    return out
