"""Fisheyes of other programs, brought to OpenCV's model over the part of it that the picture shows.

Pix4D (OPF) and Bentley (BlocksExchange) have the same model: of a point t off the axis
``theta = 2 t / pi``, ``rho = p0 + p1 theta + .. + p4 theta^4``, and a (2, 2) matrix from rho in its
direction to pixels ("How are the internal and external camera parameters defined", Pix4D;
ContextCapture User Guide, "Fisheye camera model").
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from texproj import fisheye
from texproj.arrays import Doubles
from texproj.camera import Intrinsics
from texproj.formats.interchange.model import Unusable, lens
from texproj.formats.interchange.radial import fisheye as fisheye_lens

Bend = Callable[[Doubles], Doubles]
"""(n, 2) points in the plane of angles (direction off the axis times the angle, rad) to pixels."""

RINGS, SPOKES = 40, 24
"""At which the lens is looked at."""
MOST_ERROR_PX, TOLD_ERROR_PX = 1.0, 0.005
ROUNDS = 4
"""Of the fit: its coefficients stand behind scales that it finds, too."""
TERMS = 5
"""p0 to p4 of what we write."""
NOTHING = 1e-9
"""Of a term: it moves no point by a millionth of a pixel."""


def of_bend(
    size: Sequence[float], focal: Sequence[float], center: Sequence[float], bend: Bend
) -> tuple[Intrinsics, str]:
    """OpenCV's fisheye nearest to `bend`, by linear least squares over the picture (ours).

    size: width, height; focal, center: near the lens's, pixels. Returns the lens and a note,
    empty where nothing is to be said. Raises Unusable where it is not near.
    """
    lens(size[0], size[1], focal, center)  # possible at all
    flat = _samples(size, bend)
    seen = bend(flat)
    middle, scale, dist = np.array(center, np.float64), np.array(focal, np.float64), np.zeros(8)
    system = _system(flat)
    for _ in range(ROUNDS):
        told = np.concatenate(list(((seen - middle) / scale).T))
        solved = np.linalg.lstsq(system, told, rcond=None)[0]
        if not (np.isfinite(solved).all() and min(solved[:2]) > 0):
            raise Unusable("its fisheye lens cannot be: nothing is seen where it says")
        middle = middle + solved[2:4] * scale
        scale, dist = scale * solved[:2], solved[4:]
    dist = np.where(np.abs(dist) > NOTHING, dist, 0.0)
    kept = dist if dist[4:].any() else dist[:4]
    found, note = fisheye_lens(
        (size[0], size[1]), list(scale * solved[0]), list(middle), list(kept)
    )
    error_px = _error_px(found, flat, seen)
    if not error_px <= MOST_ERROR_PX:
        raise Unusable(
            f"its fisheye lens is none that OpenCV's model comes near ({error_px:.2g} px)"
        )
    if error_px > TOLD_ERROR_PX:
        fitted = f"its fisheye lens is fitted by OpenCV's within {error_px:.2g} px"
        note = f"{note}; {fitted}" if note else fitted
    return found, note


def _system(flat: Doubles) -> Doubles:
    """(2n, 12): what scales, center and the 8 coefficients move along x, then along y."""
    (x, y), t2 = flat.T, np.einsum("ij,ij->i", flat, flat)
    zero, one = np.zeros_like(x), np.ones_like(x)
    along_x = [x, zero, one, zero, x * t2, x * t2**2, x * t2**3, x * t2**4]
    along_y = [zero, y, zero, one, y * t2, y * t2**2, y * t2**3, y * t2**4]
    along_x += [2 * x * y, t2 + 2 * x * x, t2, zero]
    along_y += [t2 + 2 * y * y, 2 * x * y, zero, t2]
    return np.concatenate([np.stack(along_x, axis=1), np.stack(along_y, axis=1)])


def of_polynomial(
    size: Sequence[float], matrix: Sequence[float], center: Sequence[float],
    polynomial: Sequence[float],
) -> tuple[Intrinsics, str]:  # fmt: skip
    """The lens of Pix4D's and Bentley's model. matrix: by rows; polynomial: p0, p1 and so on.

    Raises Unusable for what is no lens, or none that OpenCV's model comes near.
    """
    turn = np.array(matrix, np.float64).reshape(2, 2)
    if not (len(polynomial) > 1 and polynomial[1] > 0 and min(turn[0, 0], turn[1, 1]) > 0):
        raise Unusable("its fisheye lens cannot be: a scale that is not positive")

    def bend(flat: Doubles) -> Doubles:
        angle = np.sqrt(np.einsum("ij,ij->i", flat, flat))
        rho = np.polyval(list(reversed(polynomial)), 2 / np.pi * angle)
        direction = flat * np.divide(rho, angle, out=np.zeros_like(rho), where=angle > 0)[:, None]
        return np.asarray(direction @ turn.T + np.asarray(center))

    focal = np.diag(turn) * polynomial[1] * 2 / np.pi
    return of_bend(size, focal.tolist(), center, bend)


def polynomial_of(k: Intrinsics) -> tuple[tuple[float, float], tuple[float, ...], str]:
    """The diagonal of the matrix (2,), p0 to p4, and a note, of one of our fisheyes.

    By least squares over the radii of the picture; tangential and prism terms have no place.
    """
    t = np.linspace(0, _widest(k), RINGS)[1:]
    radius = t * np.polyval([*reversed(k.dist[:4]), 1.0], t**2)
    theta = 2 / np.pi * t
    powers = np.stack([theta**n for n in range(1, TERMS)], axis=1)
    solved = np.linalg.lstsq(powers, radius, rcond=None)[0]
    error_px = float(np.abs(powers @ solved - radius).max()) * max(k.fx, k.fy)
    note = (
        f"its lens is fitted by the format's polynomial within {error_px:.2g} px"
        if error_px > TOLD_ERROR_PX
        else ""
    )
    rest = np.where(np.abs(solved / solved[0]) > NOTHING, solved / solved[0], 0.0)
    matrix = float(k.fx * solved[0]), float(k.fy * solved[0])
    return matrix, (0.0, *rest.tolist()), note


def beyond_radial(k: Intrinsics) -> dict[str, float]:
    """Tangential and prism terms of a fisheye by name."""
    return dict(zip(("p1", "p2", "s1", "s2"), k.dist[4:], strict=False))


def _widest(k: Intrinsics) -> float:
    """Angle off the axis, rad, up to which the picture reaches."""
    limit = fisheye.limit_rad(k.dist)
    t = np.linspace(0, limit, 20 * RINGS)[1:]
    far = np.hypot(max(k.cx, k.width - k.cx) / k.fx, max(k.cy, k.height - k.cy) / k.fy)
    reached = np.flatnonzero(t * np.polyval([*reversed(k.dist[:4]), 1.0], t**2) >= far)
    return float(t[reached[0]]) if len(reached) else limit


def _samples(size: Sequence[float], bend: Bend) -> Doubles:
    """(n, 2) points in the plane of angles that the picture shows, up to where a ring is the last
    that it shows or the lens folds back. Raises Unusable for too few.
    """
    angle = np.linspace(0, fisheye.WIDEST_RAD, RINGS + 1)[1:]
    around = np.linspace(0, 2 * np.pi, SPOKES, endpoint=False)
    spokes = np.stack([np.cos(around), np.sin(around)], axis=1)
    flat = (angle[:, None, None] * spokes).reshape(-1, 2)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        seen = bend(flat)
        inside = ((seen >= 0) & (seen <= size)).all(axis=1).reshape(RINGS, SPOKES)
        out = np.linalg.norm(seen.reshape(RINGS, SPOKES, 2) - seen.mean(axis=0), axis=2)
        grows = np.concatenate([[True], (np.diff(out, axis=0) > 0).mean(axis=1) > 0.5])
    good = inside.any(axis=1) & np.logical_and.accumulate(grows)
    chosen = (inside & good[:, None]).ravel()
    if np.count_nonzero(chosen) < SPOKES:
        raise Unusable("its fisheye lens cannot be: nothing is seen inside the picture")
    return np.asarray(flat[chosen])


def _error_px(found: Intrinsics, flat: Doubles, seen: Doubles) -> float:
    """Largest distance from where points are seen, within the domain of the lens."""
    angle = np.sqrt(np.einsum("ij,ij->i", flat, flat))
    inside = angle < min(np.arctan(found.max_radius), fisheye.WIDEST_RAD) * (1 - 1e-9)
    ideal = flat * (np.tan(angle) / angle)[:, None]
    ours = found.distort(ideal[inside]) * (found.fx, found.fy) + (found.cx, found.cy)
    return float(np.abs(ours - seen[inside]).max(initial=0.0))
