"""What a camera from a file may be: every reader makes its cameras here, so that all methods may
rely on finite numbers of possible size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from texproj.camera import LENGTHS, Intrinsics, LensModel, Pose
from texproj.errors import InputError

Array = NDArray[np.float64]

MOST_SIDE_PX = 200_000
"""Longest side of a photo; twelve times what sensors have, three times what a JPEG can hold."""

FOCAL_OVER_SIDE = (0.02, 10_000.0)
"""Focal length over the longer side: 175 degrees wide, and 20 seconds of arc narrow."""

MOST_CENTER_OFFSET = 10.0
"""Distance of the principal point from the picture's middle over the longer side: far beyond
what shift lenses and crops leave.
"""

MOST_DISTORTION = 100.0
"""What one coefficient may add to the scale at the picture's corner; real lenses stay below 1,
and fits to few points below 10.
"""

MOST_TILT_RAD = 1.5
"""OpenCV's two angles of a tilted sensor; at a right angle it sees nothing."""

MOST_TRANSLATION = 1e15
"""Mesh units: double precision then has steps of 0.1; the Earth in micrometres fits."""

ROTATION_TOLERANCE = 1e-3
"""Largest error of R @ R.T against the identity; four printed digits stay below."""

_TERMS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tx", "ty")
_POWERS = (2, 4, 1, 1, 6, 2, 4, 6, 1, 3, 1, 3)
"""Power of the radius by which each term scales the picture; those of s1..s4 are r^2 and r^4."""


def checked_intrinsics(
    width: Any, height: Any, focal: ArrayLike, center: ArrayLike, dist: ArrayLike, where: str,
    model: LensModel = "perspective",
) -> Intrinsics:  # fmt: skip
    """The intrinsics that a file states, if a camera can have them.

    width, height: whole numbers of pixels of any type; focal: fx, fy or one number for both;
    center: cx, cy, from the image corner; dist: 0, 4, 5, 8, 12 or 14 of OpenCV's coefficients, 4
    or 8 of a fisheye.
    Raises InputError that names `where`, the key and its bounds.
    """
    w, h = _side(width, f"{where}: width"), _side(height, f"{where}: height")
    fx, fy = np.broadcast_to(_finite(focal, (1, 2), f"{where}: focal length"), 2).tolist()
    cx, cy = _finite(center, (2,), f"{where}: principal point").tolist()
    coefficients = tuple(_finite(dist, LENGTHS[model], f"{where}: dist").tolist())
    longer = max(w, h)
    low, high = (bound * longer for bound in FOCAL_OVER_SIDE)
    if not (low <= fx <= high and low <= fy <= high):
        raise InputError(
            f"{where}: the focal length {fx:g}, {fy:g} px is not possible for {w} x {h} pixels"
            f" ({low:g} to {high:g})"
        )
    if max(abs(cx - w / 2), abs(cy - h / 2)) > MOST_CENTER_OFFSET * longer:
        raise InputError(
            f"{where}: the principal point {cx:g}, {cy:g} lies more than"
            f" {MOST_CENTER_OFFSET:g} pictures away from a photo of {w} x {h} pixels"
        )
    corner = np.hypot(w, h) / 2 / min(fx, fy)
    if model == "fisheye":
        _check_fisheye(coefficients, where)
    else:
        _check_distortion(coefficients, corner, where)
    return Intrinsics(w, h, fx, fy, cx, cy, coefficients, model)


def checked_pose(R: ArrayLike, t: ArrayLike, where: str) -> Pose:
    """The pose `cam_from_world` that a file states. Raises InputError; see `checked_rotation`."""
    return Pose(checked_rotation(R, where), checked_translation(t, where))


def checked_rotation(R: ArrayLike, where: str, tolerance: float = ROTATION_TOLERANCE) -> Array:
    """(3, 3) rotation matrix, each bit as given. Raises InputError where it is none."""
    matrix = _finite(R, (9,), f"{where}: R").reshape(3, 3)
    bounded = np.abs(matrix).max() < 2
    error = np.abs(matrix @ matrix.T - np.eye(3)).max() if bounded else np.inf
    if error > tolerance or np.linalg.det(matrix) < 0:
        raise InputError(f"{where}: R is not a rotation (orthonormal rows, determinant +1)")
    return matrix


def checked_translation(t: ArrayLike, where: str, key: str = "t") -> Array:
    """(3,) translation or center in mesh units. Raises InputError where it is impossible."""
    vector = _finite(t, (3,), f"{where}: {key}")
    if np.abs(vector).max() > MOST_TRANSLATION:
        raise InputError(
            f"{where}: {key} = {vector.tolist()} lies beyond {MOST_TRANSLATION:g} mesh units"
        )
    return vector


def _check_distortion(dist: tuple[float, ...], corner: float, where: str) -> None:
    """Refuse what no lens does at the picture's corner, `corner` = tangent of its angle."""
    for name, value, power in zip(_TERMS, dist, _POWERS, strict=False):
        if abs(value) * corner**power > MOST_DISTORTION:
            raise InputError(
                f"{where}: dist: {name} = {value:g} scales the picture's corner by"
                f" {abs(value) * corner**power:.3g}; at most {MOST_DISTORTION:g} is possible"
            )
    for name, value in zip(_TERMS[12:], dist[12:], strict=False):
        if abs(value) > MOST_TILT_RAD:
            raise InputError(f"{where}: dist: {name} = {value:g} rad; at most {MOST_TILT_RAD}")


def _check_fisheye(dist: tuple[float, ...], where: str) -> None:
    """Refuse what no fisheye does a radian off its axis."""
    for number, value in enumerate(dist):
        if abs(value) > MOST_DISTORTION:
            raise InputError(
                f"{where}: dist[{number}] = {value:g} of a fisheye; at most {MOST_DISTORTION:g} is"
                " possible"
            )


def _side(value: Any, where: str) -> int:
    side = float(_finite(value, (1,), where)[0])
    if side != round(side) or not 1 <= side <= MOST_SIDE_PX:
        raise InputError(f"{where} = {side:g}: a whole number of 1 to {MOST_SIDE_PX} pixels needed")
    return int(side)


def _finite(value: Any, lengths: tuple[int, ...], where: str) -> Array:
    """(n,) finite numbers, n one of `lengths`."""
    counts = " or ".join(map(str, lengths))
    try:
        array = np.array(value, np.float64).ravel()
    except (TypeError, ValueError, OverflowError):  # words, lists of unequal lengths, long integers
        raise InputError(f"{where}: {counts} numbers expected") from None
    if len(array) not in lengths:
        raise InputError(f"{where}: {counts} numbers expected, {len(array)} given")
    if not np.isfinite(array).all():
        raise InputError(f"{where}: a number is not finite")
    return array
