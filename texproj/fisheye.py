"""The lens model of fisheyes: a point t radians off the axis lies near t focal lengths from the
principal point.

Kannala and Brandt, "A generic camera model and calibration method", PAMI 2006, as OpenCV has it
(cv2.fisheye), with COLMAP's tangential and thin-prism terms (THIN_PRISM_FISHEYE)::

    u = (x, y) t / r,  r = |(x, y)| = tan t
    out = u (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)
        + (2 p1 ux uy + p2 (t^2 + 2 ux^2), 2 p2 ux uy + p1 (t^2 + 2 uy^2)) + (s1, s2) t^2
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FISHEYE_LENGTHS = (4, 8)
"""Numbers of coefficients: k1 k2 k3 k4 [p1 p2 s1 s2]."""

WIDEST_RAD = float(np.radians(75.0))
"""Angle off the axis up to which the model is used: farther out the flat picture from which depth
is read would be mostly border."""

STEPS, LOST = 50, 5
"""Most steps of Newton's method, and after how many a point that is still led out of the domain is
taken to have no place in it."""
TOLERANCE = 1e-9
"""Of a step, rad: the next one would be a rounding error."""


def limit_rad(dist: tuple[float, ...]) -> float:
    """Largest angle off the axis, rad, up to which the radial part grows, at most `WIDEST_RAD`."""
    k1, k2, k3, k4 = dist[:4]
    slope = np.array([9 * k4, 7 * k3, 5 * k2, 3 * k1, 1.0])  # of t^2, highest power first
    slope[:4][np.abs(slope[:4]) < 1e-21] = 0  # else the roots of what moves nothing overflow
    roots = np.roots(slope)
    turning = [r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 0]
    return float(min([WIDEST_RAD, *np.sqrt(turning)]))


def distort(xy: Array, dist: tuple[float, ...]) -> Array:
    """(n, 2) ideal coordinates (x/z, y/z) to distorted ones; no check of the domain."""
    r = np.sqrt(np.einsum("ij,ij->i", xy, xy))
    angle = np.arctan(r)
    flat = xy * np.divide(angle, r, out=np.ones_like(r), where=r > 0)[:, None]
    return _bent(flat, dist)


def undistort(target: Array, dist: tuple[float, ...]) -> Array:
    """(n, 2) distorted coordinates to ideal ones, NaN where there are none.

    Newton iteration in the plane of angles, where the map is near the identity.
    """
    limit = limit_rad(dist)
    size = np.sqrt(np.einsum("ij,ij->i", target, target))
    flat = target * np.minimum(1, 0.95 * limit / np.maximum(size, 1e-300))[:, None]
    active = np.arange(len(target))
    for number in range(STEPS):
        step = _newton_step(flat[active], target[active], dist)
        flat[active] -= step
        angle = np.sqrt(np.einsum("ij,ij->i", flat[active], flat[active]))
        flat[active] *= np.minimum(1, limit / np.maximum(angle, 1e-300))[:, None]
        moving = np.abs(step).max(axis=1) > TOLERANCE
        active = active[moving & ((angle < limit) | (number < LOST))]
        if not len(active):
            break
    error = np.abs(_bent(flat, dist) - target).max(axis=1, initial=0)
    angle = np.sqrt(np.einsum("ij,ij->i", flat, flat))
    tangent = np.tan(np.minimum(angle, limit))
    ideal: Array = (
        flat * np.divide(tangent, angle, out=np.ones_like(angle), where=angle > 0)[:, None]
    )
    ideal[~((error < 1e-11) & (angle < limit))] = np.nan
    return ideal


def _bent(flat: Array, dist: tuple[float, ...]) -> Array:
    """(n, 2) places in the plane of angles to distorted coordinates."""
    k1, k2, k3, k4, p1, p2, s1, s2 = (*dist, *(0.0,) * 4)[:8]
    t2 = np.einsum("ij,ij->i", flat, flat)
    out: Array = flat * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))[:, None]
    if p1 or p2 or s1 or s2:
        x, y = flat.T
        out[:, 0] += 2 * p1 * x * y + p2 * (t2 + 2 * x * x) + s1 * t2
        out[:, 1] += 2 * p2 * x * y + p1 * (t2 + 2 * y * y) + s2 * t2
    return out


def _newton_step(flat: Array, target: Array, dist: tuple[float, ...]) -> Array:
    """(n, 2) solution of J step = bent(flat) - target."""
    k1, k2, k3, k4, p1, p2, s1, s2 = (*dist, *(0.0,) * 4)[:8]
    x, y = flat.T
    t2 = x * x + y * y
    radial = 1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))
    growth = 2 * (k1 + t2 * (2 * k2 + t2 * (3 * k3 + t2 * 4 * k4)))  # d radial / d t2, twice
    a = radial + growth * x * x + 2 * p1 * y + 6 * p2 * x + 2 * s1 * x
    b = growth * x * y + 2 * p1 * x + 2 * p2 * y + 2 * s1 * y
    c = growth * x * y + 2 * p2 * y + 2 * p1 * x + 2 * s2 * x
    d = radial + growth * y * y + 2 * p2 * x + 6 * p1 * y + 2 * s2 * y
    ex, ey = (_bent(flat, dist) - target).T
    det = a * d - b * c
    det = np.where(np.abs(det) < 1e-9, 1e-9, det)
    return np.stack([(d * ex - b * ey) / det, (a * ey - c * ex) / det], axis=1)
