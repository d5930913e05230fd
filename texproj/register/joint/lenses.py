"""What the photos of one lens have in common: where its solution starts, what is known of it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera, Intrinsics
from texproj.register.joint.holding import Picks
from texproj.solve.lm import minimize
from texproj.solve.reprojection import Reprojection, intrinsic_value
from texproj.solve.shared_lens import LensParameters, SharedIntrinsics

RADIAL, CENTRAL = ("focal", "k1", "k2"), ("cx", "cy", "aspect")
"""Shared by all photos of a lens; and by those of them that are held the same way, since a turned
photo has its principal point elsewhere."""
FOCAL_SIGMA = 0.02
"""Trust in the focal length that the photos of one lens have found on average: relative."""
RADIAL_SIGMA, CENTER_SIGMA, ASPECT_SIGMA = 0.05, 0.02, 0.005
"""Of k1 and k2; of the principal point, as a part of the longer side; of fy / fx. Lenses of real
scenes: k1 -.15 to .02, the principal point of one off center by 2.2 %."""
GIVEN = 1e-3
"""The sigmas of an intrinsic other than the focal length are so many times smaller where the lens
was given: what is left of it is smaller than what the shape of the mesh makes of it."""
LONGEST_MODEL = 5
"""Distortion coefficients beyond which k1 and k2 do not stand for themselves, and are kept."""
LEAST_POINTS = 6
"""Surface points in view with which a pose can follow a change of the lens."""


@dataclass(frozen=True, eq=False)
class PhotoStart:
    """One photo before all are refined together.

    camera: full size, registered to a few pixels; sigma_px: its expected error, full-size pixels;
    lens: equal for photos of the same lens; given: the lens was known beforehand, not estimated;
    fixed: the camera must not move, the others follow it; picks: they hold the frame; sought_again:
    the camera was found by what the others show, since its own contradicted them.
    """

    camera: Camera
    sigma_px: float
    lens: Hashable = 0
    given: bool = False
    fixed: bool = False
    picks: Picks | None = None
    sought_again: bool = False


def shared_lenses(
    photos: Sequence[PhotoStart], points: Sequence[Doubles]
) -> tuple[tuple[Camera, ...], LensParameters]:
    """The cameras with the median lens of those that share it, and what is solved of it.

    points: of each photo (n, 3) world points in its view.
    """
    lens = _numbered([photo.lens for photo in photos])
    held = [p.camera.intrinsics for p in photos]
    turned = _numbered([(p.lens, k.width, k.height) for p, k in zip(photos, held, strict=True)])
    fixed = np.array([photo.fixed for photo in photos])
    free = ~np.isin(lens, lens[fixed])
    start = tuple(
        _relensed(photo.camera, _common_lens(held, lens, k), points[k]) if free[k] else photo.camera
        for k, photo in enumerate(photos)
    )
    given = np.array([photo.given for photo in photos])
    return start, LensParameters((
        _block(RADIAL, lens, start, given, free), _block(CENTRAL, turned, start, given, free),
    ))  # fmt: skip


def with_aspect(lenses: LensParameters, group: int) -> LensParameters:
    """The same with fy / fx solved in one group of photos held the same way."""
    radial, central = lenses.blocks
    free = central.free.copy()
    free[group, CENTRAL.index("aspect")] = True
    return LensParameters((radial, replace(central, free=free)))


def _numbered(keys: Sequence[Hashable]) -> NDArray[np.intp]:
    names = list(dict.fromkeys(keys))
    return np.array([names.index(key) for key in keys], np.intp)


def _block(
    names: tuple[str, ...], group: NDArray[np.intp], cameras: Sequence[Camera],
    given: NDArray[np.bool_], free: NDArray[np.bool_],
) -> SharedIntrinsics:  # fmt: skip
    """What is known of the intrinsics `names`, from the first camera of each group."""
    first = [int(np.flatnonzero(group == g)[0]) for g in range(group.max() + 1)]
    lens = [cameras[k].intrinsics for k in first]
    value = np.array([[intrinsic_value(one, name) for name in names] for one in lens])
    sigma = np.array([
        [_sigma(name, one) * (GIVEN if given[k] and name != "focal" else 1) for name in names]
        for k, one in zip(first, lens, strict=True)
    ])  # fmt: skip
    solved = np.array([[_solved(name, one) for name in names] for one in lens])
    return SharedIntrinsics(names, group, value, sigma, solved & free[first][:, None])


def _sigma(name: str, lens: Intrinsics) -> float:
    if name in ("cx", "cy"):
        return CENTER_SIGMA * max(lens.width, lens.height)
    return {"focal": FOCAL_SIGMA, "aspect": ASPECT_SIGMA}.get(name, RADIAL_SIGMA)


def _solved(name: str, lens: Intrinsics) -> bool:
    if name in ("k1", "k2"):
        return len(lens.dist) <= LONGEST_MODEL and not lens.is_fisheye
    return name != "aspect"


def _common_lens(lenses: Sequence[Intrinsics], group: NDArray[np.intp], k: int) -> Intrinsics:
    """The median of what the photos of one lens have found for it: focal length over all,
    principal point and distortion over those of the same format.
    """
    own = lenses[k]
    alike = [lens for lens, g in zip(lenses, group, strict=True) if g == group[k]]
    fx = float(np.exp(np.median(np.log([lens.fx for lens in alike]))))
    same = [
        lens for lens in alike
        if (lens.width, lens.height, lens.model, len(lens.dist))
        == (own.width, own.height, own.model, len(own.dist))
    ]  # fmt: skip
    aspect = float(np.median([lens.fy / lens.fx for lens in same]))
    cx, cy = np.median([(lens.cx, lens.cy) for lens in same], axis=0)
    dist = np.median([lens.dist for lens in same], axis=0)
    return replace(own, fx=fx, fy=fx * aspect, cx=float(cx), cy=float(cy), dist=tuple(dist))


def _relensed(camera: Camera, lens: Intrinsics, points: Doubles) -> Camera:
    """The camera with another lens, at the pose from which the surface looks most the same."""
    xy, _ = camera.project(points)
    usable = np.isfinite(xy).all(axis=1)
    if lens == camera.intrinsics or usable.sum() < LEAST_POINTS:
        return Camera(lens, camera.pose)
    problem = Reprojection(xy[usable], points[usable])
    return minimize(problem, Camera(lens, camera.pose)).x
