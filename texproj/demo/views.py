"""Where the demo's photographer stands, and with what in hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera, Intrinsics, Pose


@dataclass(frozen=True)
class Body:
    """A camera and its lens. focal: focal length over the photo's longer side;
    center_shift: of the principal point, as a share of the longer side; iso, f_number: settings.
    """

    name: str
    focal: float
    center_shift: tuple[float, float]
    dist: tuple[float, float, float, float, float]
    iso: int
    f_number: float

    def intrinsics(self, width: int, height: int) -> Intrinsics:
        """For photos of a size."""
        side = max(width, height)
        x, y = (share * side for share in self.center_shift)
        f = self.focal * side
        return Intrinsics(width, height, f, f, width / 2 + x, height / 2 + y, self.dist)


COMPACT = Body("Demo Compact", 1.02, (0.008, -0.009), (-0.115, 0.062, 6e-4, -4e-4, -0.01), 200, 5.6)
REFLEX = Body("Demo Reflex", 1.21, (-0.006, 0.004), (0.046, -0.031, -3e-4, 5e-4, 0.0), 100, 8.0)


@dataclass(frozen=True)
class View:
    """azimuth 0 looks at the front and counts to the right; distance in piece diagonals;
    ev: exposure step; upright: the photo is higher than wide.
    """

    azimuth_deg: float
    elevation_deg: float
    distance: float = 1.16
    ev: float = 0.0
    upright: bool = True
    visitor: bool = False
    body: Body = COMPACT


TOUR = (
    View(-12, 12, ev=0.2, body=REFLEX),
    View(-48, 22, ev=-0.2),
    View(-85, 10, ev=0.0, body=REFLEX),
    View(-128, 24, ev=0.4),
    View(172, 14, 1.42, ev=1.1, upright=False, body=REFLEX),
    View(130, 28, ev=1.2),
    View(82, 12, ev=0.8, body=REFLEX),
    View(38, 18, ev=0.5, visitor=True),
    View(14, 44, 1.38, ev=-0.2, upright=False, body=REFLEX),
)
"""A round: eight views all around and one from above, too far apart to find each other."""


ARC_DEG = 66.0
"""How far to either side of the front somebody walks who photographs it."""
HEIGHTS_DEG = (10.0, 24.0, 38.0)
EXPOSURES = (0.2, -0.2, 0.0, 0.4)


def arc(photos: int) -> tuple[View, ...]:
    """`photos` views of the front from left to right, each near the next, from three heights, by
    two cameras; somebody walks into one of them.
    """
    azimuths = np.linspace(-ARC_DEG, ARC_DEG, photos) if photos > 1 else np.zeros(1)
    return tuple(
        View(
            float(azimuth),
            HEIGHTS_DEG[k % len(HEIGHTS_DEG)],
            ev=EXPOSURES[k % len(EXPOSURES)],
            visitor=k == photos // 3,
            body=REFLEX if 2 * k < photos else COMPACT,
        )
        for k, azimuth in enumerate(azimuths)
    )


def tour(photos: int) -> tuple[View, ...]:
    """`photos` views: the round, then again from other angles and heights."""
    rounds = -(-photos // len(TOUR))
    views = [
        replace(v, azimuth_deg=v.azimuth_deg + 19 * k, elevation_deg=v.elevation_deg + 6 * k,
                visitor=v.visitor and not k)
        for k in range(rounds) for v in TOUR
    ]  # fmt: skip
    return tuple(views[:photos])


def camera_at(
    view: View, bounds: NDArray[np.float64], long_side: int, rng: np.random.Generator
) -> Camera:
    """The camera of a view of the piece inside (2, 3) bounds, held by hand: not quite level,
    not quite centered.
    """
    size = (
        (round(long_side / 1.5), long_side) if view.upright else (long_side, round(long_side / 1.5))
    )
    diagonal = float(np.linalg.norm(bounds[1] - bounds[0]))
    azimuth, elevation = np.radians([view.azimuth_deg - 90, view.elevation_deg])
    out = [
        np.cos(elevation) * np.cos(azimuth),
        np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ]
    middle = bounds.mean(0) + rng.normal(0, 0.012, 3) * diagonal
    eye = middle + np.array(out) * (view.distance * view.body.focal * diagonal)
    pose = Pose.look_at(eye, middle)
    roll = np.array([0, 0, np.radians(rng.normal(0, 1.5)), 0, 0, 0])
    return Camera(view.body.intrinsics(*size), pose.step(roll))


def disturbed(
    camera: Camera, xyz_in_world: NDArray[np.float64], error_px: float, rng: np.random.Generator
) -> Camera:
    """A start for registration: turned about the points' middle and shifted at random, so that
    the (n, 3) points' images move by `error_px` on average.
    """
    before, _ = camera.project(xyz_in_world)
    middle = camera.pose.apply(xyz_in_world.mean(0)[None])[0]
    turn, shift = rng.normal(size=(2, 3)) * 0.01

    def moved(size: float) -> Camera:
        R = cv2.Rodrigues(turn * size)[0]
        about = Pose(R, middle - R @ middle + shift * size * middle[2])
        return replace(camera, pose=about @ camera.pose)

    size = 1.0
    for _ in range(40):
        after, _ = moved(size).project(xyz_in_world)
        error = float(np.nanmean(np.linalg.norm(after - before, axis=1)))
        size *= float(np.clip(error_px / max(error, 1e-9), 0.5, 2))
    return moved(size)
