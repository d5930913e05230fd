"""Radial polynomials with a term that OpenCV's lens model has no place for."""

from __future__ import annotations

import numpy as np

from texproj.camera import Intrinsics

SAMPLES = 200


def with_fourth_order(intrinsics: Intrinsics, k4: float) -> tuple[Intrinsics, str]:
    """The lens with ``k4 r^8`` added to its radial factor 1 + k1 r^2 + k2 r^4 + k3 r^6.

    OpenCV has no such term: the factor is fitted by its rational one (six coefficients, linear
    least squares of numerator - denominator * factor over the picture's radii; ours). Returns the
    lens and a note with the largest error in pixels; the note is empty for k4 = 0.
    """
    if not k4:
        return intrinsics, ""
    k1, k2, p1, p2, k3 = (*intrinsics.dist, *(0.0,) * 5)[:5]
    polynomial = np.array([k4, k3, k2, k1, 1.0])
    r = _radii(intrinsics, polynomial)
    s = r**2
    factor = np.polyval(polynomial, s)
    powers = np.stack([s, s**2, s**3], axis=1)
    system = np.concatenate([powers, -factor[:, None] * powers], axis=1) * r[:, None]
    a1, a2, a3, b1, b2, b3 = np.linalg.lstsq(system, (factor - 1) * r, rcond=None)[0]
    fitted = Intrinsics(
        intrinsics.width, intrinsics.height, intrinsics.fx, intrinsics.fy,
        intrinsics.cx, intrinsics.cy, (a1, a2, p1, p2, a3, b1, b2, b3),
    )  # fmt: skip
    told = (1 + powers @ [a1, a2, a3]) / (1 + powers @ [b1, b2, b3])
    error = float(np.abs((told - factor) * r).max()) * max(intrinsics.fx, intrinsics.fy)
    return fitted, f"k4 = {k4:.6g} is fitted by OpenCV's rational lens within {error:.2g} px"


def _radii(intrinsics: Intrinsics, polynomial: np.ndarray) -> np.ndarray:
    """Undistorted radii from the axis to where the farthest corner of the picture is reached."""
    x = max(intrinsics.cx, intrinsics.width - intrinsics.cx) / intrinsics.fx
    y = max(intrinsics.cy, intrinsics.height - intrinsics.cy) / intrinsics.fy
    corner = float(np.hypot(x, y))
    r = np.linspace(0, 2 * corner, 2 * SAMPLES)[1:]
    reached = np.flatnonzero(r * np.polyval(polynomial, r**2) >= corner)
    return r[: reached[0] + 1] if len(reached) else r[:SAMPLES]
