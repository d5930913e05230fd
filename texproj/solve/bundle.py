"""Bundle adjustment: cameras, their shared lenses and the points of tracks in one robust least
squares, with points that lie softly on a surface and points whose places are known.

Each step solves for the cameras alone; the points are eliminated by their Schur complement (Triggs
et al., "Bundle adjustment - a modern synthesis", 2000, section 6.1). Point-to-plane: Chen and
Medioni, "Object modelling by registration of multiple range images", 1992.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.solve.lm import FAR, Loss
from texproj.solve.reprojection import projection_jacobian
from texproj.solve.shared_lens import LensParameters

Numbers = NDArray[np.intp]
Cameras = tuple[Camera, ...]

TRACK_LOSS = Loss("cauchy", 2.0)
PLANE_LOSS = Loss("geman-mcclure", 3.0)
"""What the scan lacks (leaves, people, ground) lies anywhere: such points do not pull."""
KNOWN_LOSS = Loss("cauchy", 2.0)
FIRST_DAMPING, MOST_DAMPING = 1e-4, 1e8
GROWTH = 4.0
ENOUGH = 1e-5
"""Part of the cost that a step must gain for another one to be made."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """m sightings of points that are solved. camera, point: (m,) numbers; px: (m, 2); sigma_px:
    (m,) noise.
    """

    camera: Numbers
    point: Numbers
    px: Doubles
    sigma_px: Doubles


@dataclass(frozen=True, eq=False)
class Planes:
    """k points that lie on the surface. point: (k,) numbers; on_plane, normal: (k, 3) world, the
    plane that touches it there; sigma: (k,) how far off they may be, mesh units.
    """

    point: Numbers
    on_plane: Doubles
    normal: Doubles
    sigma: Doubles


@dataclass(frozen=True, eq=False)
class KnownPoints:
    """s sightings of points whose place is known. camera: (s,) numbers; xyz: (s, 3) world; px:
    (s, 2); sigma_px: (s,) noise; weight: (s,) for how many independent sightings each counts.
    """

    camera: Numbers
    xyz: Doubles
    px: Doubles
    sigma_px: Doubles
    weight: Doubles


@dataclass(frozen=True, eq=False)
class Bundle:
    """The problem. lenses: what photos share, and what is known of it beforehand."""

    tracks: Tracks
    planes: Planes
    known: KnownPoints
    lenses: LensParameters


@dataclass(frozen=True, eq=False)
class Adjusted:
    """cameras: (c,); points: (n, 3) world; cost: half of it is minus the logarithm of likelihood;
    information: (6 c + lens parameters,) square, of the cameras, each as `Pose.step`, and of the
    lenses, the points eliminated.
    """

    cameras: Cameras
    points: Doubles
    cost: float
    information: Doubles

    def covariance(self) -> Doubles:
        """The inverse of `information`; infinite where that says nothing."""
        scale = np.sqrt(np.maximum(np.diag(self.information), 1e-300))
        scaled = self.information / np.outer(scale, scale)
        try:
            inverse = np.linalg.inv(scaled)
        except np.linalg.LinAlgError:
            inverse = np.full(scaled.shape, np.inf)
        if not (np.isfinite(inverse).all() and (np.diag(inverse) > 0).all()):
            return np.full(scaled.shape, np.inf)
        covariance: Doubles = inverse / np.outer(scale, scale)
        return covariance


def adjust(problem: Bundle, cameras: Cameras, points: Doubles, most_steps: int) -> Adjusted:
    """The minimum downhill from here, after at most so many steps."""
    here, damping = _Linearized.at(problem, cameras, points), FIRST_DAMPING
    for _ in range(most_steps):
        moved = here.moved(problem, damping)
        cost = _cost(problem, *moved)
        while not cost < here.cost and damping < MOST_DAMPING:
            damping *= GROWTH
            moved = here.moved(problem, damping)
            cost = _cost(problem, *moved)
        if not cost < here.cost:
            break
        gained, damping = here.cost - cost, damping / GROWTH
        here = _Linearized.at(problem, *moved)
        if gained < ENOUGH * here.cost:
            break
    return Adjusted(here.cameras, here.points, here.cost, here.reduced(0.0)[0].toarray())


def track_residuals(tracks: Tracks, cameras: Cameras, points: Doubles) -> Doubles:
    """(m, 2) projected minus seen over sigma; NaN where not seen."""
    return _seen(tracks.camera, points[tracks.point], tracks.px, cameras) / tracks.sigma_px[:, None]


def known_residuals(known: KnownPoints, cameras: Cameras) -> Doubles:
    """(s, 2) projected minus seen over sigma; NaN where not seen."""
    return _seen(known.camera, known.xyz, known.px, cameras) / known.sigma_px[:, None]


def plane_residuals(planes: Planes, points: Doubles) -> Doubles:
    """(k,) distances over sigma."""
    gap = points[planes.point] - planes.on_plane
    out: Doubles = np.einsum("ki,ki->k", gap, planes.normal) / planes.sigma
    return out


def _seen(camera: Numbers, xyz: Doubles, px: Doubles, cameras: Cameras) -> Doubles:
    out = np.full((len(camera), 2), np.nan)
    for k in np.unique(camera):
        rows = camera == k
        out[rows] = cameras[k].project(xyz[rows])[0] - px[rows]
    return out


def _squares(residual: Doubles) -> Doubles:
    """(n,) squared lengths of (n, 2) rows, those of what is not seen as `FAR` off."""
    s = (residual**2).sum(axis=1)
    return np.minimum(np.where(np.isfinite(s), s, np.inf), FAR**2)


def _cost(problem: Bundle, cameras: Cameras, points: Doubles) -> float:
    tracks = TRACK_LOSS.cost(_squares(track_residuals(problem.tracks, cameras, points)))
    known = KNOWN_LOSS.cost(_squares(known_residuals(problem.known, cameras)))
    planes = PLANE_LOSS.cost(plane_residuals(problem.planes, points) ** 2)
    lens = problem.lenses.prior(cameras)[0]
    return float(tracks.sum() + (problem.known.weight * known).sum() + planes.sum() + lens @ lens)


@dataclass(frozen=True, eq=False)
class _Linearized:
    """Normal equations around cameras and points: information of the cameras (p, p) sparse, of each
    point (n, 3, 3), of both together (p, 3 n) sparse, and the gradients of half the cost.
    """

    cameras: Cameras
    points: Doubles
    cost: float
    of_cameras: sparse.csc_matrix
    of_points: Doubles
    of_both: sparse.csr_matrix
    by_cameras: Doubles
    by_points: Doubles

    @classmethod
    def at(cls, problem: Bundle, cameras: Cameras, points: Doubles) -> _Linearized:
        tracks, known, planes = problem.tracks, problem.known, problem.planes
        names = problem.lenses.names
        off = track_residuals(tracks, cameras, points)
        weight = _weights(off, TRACK_LOSS)
        own = _derivatives(tracks.camera, points[tracks.point], tracks.sigma_px, cameras, names)
        turned = np.stack([camera.pose.R for camera in cameras])[tracks.camera]
        by_point = own[:, :, 3:6] @ turned
        rows, values = np.sqrt(weight)[:, None], np.nan_to_num(off) * np.sqrt(weight)[:, None]
        cameras_by = _scattered(own * rows[..., None], tracks.camera, problem.lenses, len(cameras))
        points_by = _of_points(by_point * rows[..., None], tracks.point, len(points))
        given = known_residuals(known, cameras)
        trust = np.sqrt(_weights(given, KNOWN_LOSS) * known.weight)[:, None]
        columns = _derivatives(known.camera, known.xyz, known.sigma_px, cameras, names)
        known_by = _scattered(
            columns * trust[..., None], known.camera, problem.lenses, len(cameras)
        )
        far, hold = problem.lenses.prior(cameras)
        lens = sparse.diags(np.concatenate([np.zeros(6 * len(cameras)), hold]))
        by_cameras = (
            cameras_by.T @ values.ravel() + known_by.T @ (np.nan_to_num(given) * trust).ravel()
        )
        by_cameras[6 * len(cameras) :] += hold * far
        by_points = (points_by.T @ values.ravel()).reshape(-1, 3)
        of_points = _outer(by_point * rows[..., None], tracks.point, len(points))
        gap = plane_residuals(planes, points)
        pull = PLANE_LOSS.weight(gap**2)
        normal = planes.normal / planes.sigma[:, None]
        np.add.at(by_points, planes.point, (pull * gap)[:, None] * normal)
        np.add.at(
            of_points, planes.point, pull[:, None, None] * normal[:, :, None] * normal[:, None]
        )
        of_cameras = cameras_by.T @ cameras_by + known_by.T @ known_by + lens.T @ lens
        cost = _cost(problem, cameras, points)
        return cls(
            cameras,
            points,
            cost,
            sparse.csc_matrix(of_cameras),
            of_points,
            sparse.csr_matrix(cameras_by.T @ points_by),
            by_cameras,
            by_points,
        )

    def reduced(self, damping: float) -> tuple[sparse.csc_matrix, Doubles, sparse.csr_matrix]:
        """Information of the cameras and gradient by them, the points eliminated; and the inverse
        (3 n, 3 n) of the points'.
        """
        diagonal = np.einsum("nii->ni", self.of_points)
        least = 1e-12 * np.maximum(diagonal.max(axis=1, keepdims=True), 1e-300)
        more = np.zeros_like(self.of_points)
        more[:, range(3), range(3)] = damping * diagonal + least
        inverse = np.linalg.inv(self.of_points + more)
        n = len(inverse)
        between = sparse.bsr_matrix(
            (inverse, np.arange(n), np.arange(n + 1)), (3 * n, 3 * n)
        ).tocsr()
        eliminated = self.of_both @ between
        left = self.of_cameras - eliminated @ self.of_both.T
        return (
            sparse.csc_matrix(left),
            self.by_cameras - eliminated @ self.by_points.ravel(),
            between,
        )

    def moved(self, problem: Bundle, damping: float) -> tuple[Cameras, Doubles]:
        """Cameras and points after a step."""
        left, gradient, between = self.reduced(damping)
        more = sparse.diags(damping * self.of_cameras.diagonal() + 1e-300)
        step = splu(sparse.csc_matrix(left + more)).solve(-gradient)
        shift = between @ (-self.by_points.ravel() - self.of_both.T @ step)
        count = 6 * len(self.cameras)
        moves, lens = step[:count].reshape(-1, 6), step[count:]
        cameras = tuple(
            Camera(problem.lenses.step(k, c.intrinsics, lens), c.pose.step(moves[k]))
            for k, c in enumerate(self.cameras)
        )
        return cameras, self.points + shift.reshape(-1, 3)


def _weights(residual: Doubles, loss: Loss) -> Doubles:
    s = _squares(residual)
    out: Doubles = np.where(s < FAR**2, loss.weight(s), 0.0)
    return out


def _derivatives(
    camera: Numbers, xyz: Doubles, sigma_px: Doubles, cameras: Cameras, names: tuple[str, ...]
) -> Doubles:
    """(m, 2, 6 + names) of the residuals by the step of their cameras and lenses."""
    out = np.zeros((len(camera), 2, 6 + len(names)))
    for k in np.unique(camera):
        rows = camera == k
        out[rows] = projection_jacobian(cameras[k], xyz[rows], names)
    return out / sigma_px[:, None, None]


def _scattered(
    blocks: Doubles, camera: Numbers, lenses: LensParameters, cameras: int
) -> sparse.csr_matrix:
    """(2 m, parameters) of (m, 2, 6 + names) blocks, in the columns of their cameras and lenses."""
    m, width = len(blocks), blocks.shape[2]
    lens = lenses.columns[camera]
    columns = np.concatenate([camera[:, None] * 6 + np.arange(6), 6 * cameras + lens], axis=1)
    free = np.concatenate([np.ones((m, 6)), lenses.free[lens]], axis=1)
    indices = np.repeat(columns.astype(np.int32)[:, None], 2, axis=1).ravel()
    starts = np.arange(0, 2 * m * width + 1, width, dtype=np.int32)
    shape = (2 * m, 6 * cameras + lenses.count)
    return sparse.csr_matrix(((blocks * free[:, None]).ravel(), indices, starts), shape)


def _of_points(blocks: Doubles, point: Numbers, points: int) -> sparse.csr_matrix:
    """(2 m, 3 points) of (m, 2, 3) blocks."""
    columns = (3 * point[:, None] + np.arange(3)).astype(np.int32)
    indices = np.repeat(columns[:, None], 2, axis=1).ravel()
    starts = np.arange(0, 6 * len(point) + 1, 3, dtype=np.int32)
    return sparse.csr_matrix((blocks.ravel(), indices, starts), (2 * len(point), 3 * points))


def _outer(blocks: Doubles, point: Numbers, points: int) -> Doubles:
    """(points, 3, 3) sums of J'J over the (m, 2, 3) blocks of each point."""
    out = np.zeros((points, 3, 3))
    np.add.at(out, point, np.einsum("mai,maj->mij", blocks, blocks))
    return out
