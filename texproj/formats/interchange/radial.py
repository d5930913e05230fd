"""Lenses that OpenCV's model has no place for, fitted by its rational one; fisheyes as they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Intrinsics
from texproj.formats.interchange.model import Unusable, lens

SAMPLES = 200
NEWTON_STEPS = 30
"""Of a cubic, from a start that is off by half: ten bring it to the last digit."""
MOST_ERROR_PX = 1.0
"""Error beyond which a fitted fourth term is not taken."""

Factor = Callable[[Doubles], Doubles]
"""(n,) undistorted radii to what they are multiplied by."""


def with_fourth_order(intrinsics: Intrinsics, k4: float) -> tuple[Intrinsics, str]:
    """The lens with ``k4 r^8`` added to its radial factor 1 + k1 r^2 + k2 r^4 + k3 r^6.

    Returns the lens and a note with the largest error in pixels; the note is empty for k4 = 0.
    Raises Unusable where OpenCV's lens cannot be brought near.
    """
    if not k4:
        return intrinsics, ""
    k1, k2, p1, p2, k3 = (*intrinsics.dist, *(0.0,) * 5)[:5]
    polynomial = np.array([k4, k3, k2, k1, 1.0])

    def factor(r: Doubles) -> Doubles:
        return np.polyval(polynomial, r**2)

    fitted, error_px = _fitted(intrinsics, factor, 2 * _corner(intrinsics), (p1, p2))
    if not error_px <= MOST_ERROR_PX:
        raise Unusable(
            f"its lens (k4 = {k4:.6g}) is none that OpenCV's model comes near; undistort the photos"
            " there and import the cameras of those"
        )
    return fitted, f"k4 = {k4:.6g} is fitted by OpenCV's rational lens within {error_px:.2g} px"


def of_measurements(intrinsics: Intrinsics, k: float) -> tuple[Intrinsics, str]:
    """The lens without distortion `intrinsics`, with VisualSFM's distortion of measurements.

    A measured radius m, in focal lengths, is seen at ``m (1 + k m^2)``. Returns the lens and a note
    with the largest error in pixels, empty for k = 0. Raises Unusable where it folds back inside
    the picture, or OpenCV's lens cannot be brought near.
    """
    if not k:
        return intrinsics, ""

    def factor(r: Doubles) -> Doubles:
        measured = r.copy()
        for _ in range(NEWTON_STEPS):
            slope = 1 + 3 * k * measured**2
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                measured -= (measured * (1 + k * measured**2) - r) / slope
        error = np.abs(measured * (1 + k * measured**2) - r)
        folded = ~((error < 1e-9) & (1 + 3 * k * measured**2 > 0) & (measured > 0))
        return np.where(folded, np.nan, measured / r)

    corner = _corner(intrinsics)
    seen = corner * (1 + k * corner**2)
    if not 1 + 3 * k * corner**2 > 0:
        raise Unusable(f"its lens (radial distortion {k:.6g}) folds back inside the picture")
    fitted, error_px = _fitted(intrinsics, factor, 1.01 * seen, (0.0, 0.0))
    if not error_px <= MOST_ERROR_PX:
        raise Unusable(
            f"its lens (radial distortion {k:.6g}) is none that OpenCV's model comes near"
        )
    return fitted, f"its distortion is fitted by OpenCV's rational lens within {error_px:.2g} px"


def fisheye(
    size: tuple[float, float], f: Sequence[float], c: Sequence[float], k: Sequence[float]
) -> tuple[Intrinsics, str]:
    """The lens of OpenCV's fisheye model, see `texproj.fisheye`.

    k: up to 4 radial coefficients, or all 8. Returns the lens and a note about pixels that are not
    used, empty where all are. Raises Unusable for values that no camera has.
    """
    dist = (*k, *(0.0,) * 8)[: 8 if len(k) > 4 else 4]
    intrinsics = lens(*size, f, c, dist, "fisheye")
    edge = intrinsics.distort([[0.999999 * intrinsics.max_radius, 0.0]])[0, 0]
    if edge >= _corner(intrinsics):
        return intrinsics, ""
    widest = np.degrees(np.arctan(intrinsics.max_radius))
    return intrinsics, f"of its fisheye lens {widest:.0f} degrees around the axis are used"


def _fitted(
    intrinsics: Intrinsics, factor: Factor, widest: float, tangential: tuple[float, float]
) -> tuple[Intrinsics, float]:
    """The rational lens nearest to radial factors, and its largest error in pixels.

    Six coefficients by linear least squares of numerator - denominator * factor over the radii of
    the picture (ours).
    """
    r = _radii(intrinsics, factor, widest)
    told = factor(r)
    powers = np.stack([r**2, r**4, r**6], axis=1)
    system = np.concatenate([powers, -told[:, None] * powers], axis=1) * r[:, None]
    if not np.isfinite(system).all():
        raise Unusable("its lens cannot be: what it does at the picture's corner is not finite")
    a1, a2, a3, b1, b2, b3 = np.linalg.lstsq(system, (told - 1) * r, rcond=None)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ours = (1 + powers @ [a1, a2, a3]) / (1 + powers @ [b1, b2, b3])
    error = float(np.abs((ours - told) * r).max()) * max(intrinsics.fx, intrinsics.fy)
    size, center = (intrinsics.width, intrinsics.height), (intrinsics.cx, intrinsics.cy)
    dist = (a1, a2, *tangential, a3, b1, b2, b3)
    return lens(*size, (intrinsics.fx, intrinsics.fy), center, dist), error


def _radii(intrinsics: Intrinsics, factor: Factor, widest: float) -> Doubles:
    """Undistorted radii from the axis to where the farthest corner of the picture is reached."""
    corner = _corner(intrinsics)
    r = np.linspace(0, widest, 2 * SAMPLES)[1:]
    reached = np.flatnonzero(r * factor(r) >= corner)
    return r[: reached[0] + 1] if len(reached) else r[:SAMPLES]


def _corner(intrinsics: Intrinsics) -> float:
    """Distance of the farthest corner from the principal point, in focal lengths."""
    x = max(intrinsics.cx, intrinsics.width - intrinsics.cx) / intrinsics.fx
    y = max(intrinsics.cy, intrinsics.height - intrinsics.cy) / intrinsics.fy
    return float(np.hypot(x, y))
