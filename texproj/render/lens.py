"""Lens distortion for renderers that draw pinhole pictures: the rays of a photo's pixels, and the
pinhole picture that covers them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Array, Camera, Intrinsics
from texproj.errors import RenderError

NODES = 48
"""Nodes of the spline along each side of the photo; lens models are smooth."""

SPLINE_TOLERANCE_PX = 0.01
"""Where the spline through the nodes is worse than this, every pixel is solved for."""

TABLE = 20_001
"""Entries of the table of a radial function: linear between them, exact to 1e-7."""

MARGIN_PX = 2
"""Border of the covering picture around the outermost ray."""

MAX_DENSITY = 2.0
"""Most pixels of the covering picture per pixel of the photo, along a line, at its densest."""

DIRECTIONS = np.arange(4) * np.pi / 4
"""In which the bend of a lens model is measured, rad."""

MAX_AREA = 4.0
"""Most pixels of the covering picture per pixel of the photo, in all."""


@lru_cache(maxsize=2)
def ideal_grid(intrinsics: Intrinsics) -> NDArray[np.float32]:
    """(h, w, 2) undistorted normalized coordinates (x/z, y/z) of the pixel centers, read-only.

    NaN outside of the domain of the lens model. Solved at nodes and interpolated by a cubic spline
    (ours); exact to `SPLINE_TOLERANCE_PX`.
    """
    k = intrinsics
    x = np.arange(k.width, dtype=np.float64) + 0.5
    y = np.arange(k.height, dtype=np.float64) + 0.5
    if not k.distorted:
        exact: Array | None = _separable(k, x, y)
    elif k.is_fisheye and not any(k.dist[4:]):
        exact = _radial(k, x, y)
    else:
        exact = _spline(k, x, y)
    grid = (_undistorted(k, x, y) if exact is None else exact).astype(np.float32)
    grid.flags.writeable = False
    return grid


def pinhole_cover(camera: Camera) -> Camera:
    """The pinhole camera at the same pose whose picture holds every ray of the photo.

    A photo without distortion is its own cover. Otherwise the focal length is scaled so that the
    cover is nowhere coarser than the photo, by at most `MAX_DENSITY`, and reduced again where the
    cover would have more than `MAX_AREA` times the photo's pixels (very wide lenses); a margin of
    `MARGIN_PX` surrounds it. Pixels map by the pinhole part alone:
    ``xy_px = (fx x/z + cx, fy y/z + cy)``. The principal point keeps no relation to the photo's.
    Raises RenderError for a lens model that holds nowhere in the photo.
    """
    k = camera.intrinsics
    return replace(camera, intrinsics=_cover(k)) if k.distorted else camera


@lru_cache(maxsize=32)
def _node_rays(k: Intrinsics) -> Array:
    """(n, 2) normalized rays through nodes all over the photo, edges included."""
    nodes = _undistorted(k, np.linspace(0, k.width, 33), np.linspace(0, k.height, 33))
    return nodes.reshape(-1, 2)


def ideal_radius(k: Intrinsics) -> float:
    """Largest tangent of the off-axis angle in the photo, as far as the lens model holds there."""
    return float(np.nanmax(np.linalg.norm(_node_rays(k), axis=1), initial=0))


def fills_photo(k: Intrinsics) -> bool:
    """Whether the lens model holds all over the photo."""
    return bool(np.isfinite(_node_rays(k)).all())


def straight_span(k: Intrinsics, sag_px: float) -> float:
    """Angle (rad) up to which the picture of a straight edge strays by less than `sag_px`."""
    return float(np.sqrt(8 * sag_px / max(bend(k) * max(k.fx, k.fy), 1e-30)))


@lru_cache(maxsize=32)
def bend(k: Intrinsics) -> float:
    """Largest second derivative of the distortion in the photo, per squared angle (rad^-2).

    A straight edge that spans the angle `a` strays at most ``a^2 bend / 8`` normalized units from
    the straight line between its distorted ends. Central differences; an angle spans at most
    1 + r^2 units of the ideal image at its radius r.
    """
    xy, h = _node_rays(k), 1e-3
    sides = [xy + h * np.array([np.cos(t), np.sin(t)]) * s for t in DIRECTIONS for s in (-1, 1)]
    around = np.stack([k.distort(side) for side in sides]).reshape(len(DIRECTIONS), 2, -1, 2)
    second = (around.sum(axis=1) - 2 * k.distort(xy)) / h**2
    units_per_rad = 1 + np.einsum("ij,ij->i", xy, xy)
    return float(np.nanmax(np.linalg.norm(second, axis=-1) * units_per_rad**2, initial=0))


@lru_cache(maxsize=32)
def _cover(k: Intrinsics) -> Intrinsics:
    ideal = _node_rays(k)
    ideal = ideal[np.isfinite(ideal).all(1)]
    if not len(ideal):
        raise RenderError(
            f"the distortion {list(k.dist)} of a camera bends every ray out of its picture; "
            "correct `dist` in cameras.json"
        )
    low, high = ideal.min(0), ideal.max(0)
    scale = _density(k, ideal)
    area = np.prod((high - low) * scale * (k.fx, k.fy)) / (k.width * k.height)
    fx, fy = np.array([k.fx, k.fy]) * scale * min(1.0, np.sqrt(MAX_AREA / area))
    left, top = low * (fx, fy) - MARGIN_PX
    size = np.ceil((high - low) * (fx, fy)).astype(int) + 2 * MARGIN_PX
    return Intrinsics(int(size[0]), int(size[1]), fx, fy, -left, -top)


def _density(k: Intrinsics, ideal: Array) -> float:
    """Largest stretch of the distortion at `ideal` (n, 2), between 1 and `MAX_DENSITY`."""
    h = 1e-4
    steps = [(k.distort(ideal + s) - k.distort(ideal - s)) / (2 * h) for s in np.eye(2) * h]
    stretch = np.linalg.svd(np.stack(steps, axis=-1), compute_uv=False)[:, 0] if len(ideal) else 1
    return float(np.clip(np.nanmax(stretch), 1.0, MAX_DENSITY))


def _separable(k: Intrinsics, x: Array, y: Array) -> Array:
    return np.stack(np.meshgrid((x - k.cx) / k.fx, (y - k.cy) / k.fy), axis=-1)


def _radial(k: Intrinsics, x: Array, y: Array) -> Array:
    """The grid of a fisheye with radial terms alone, by a table of its one function."""
    widest = k.distort(np.array([[k.max_radius * (1 - 1e-12), 0.0]]))[0, 0]
    bent = np.linspace(0, widest, TABLE)
    ideal = k.undistort(np.stack([bent, np.zeros(TABLE)], axis=1))[:, 0]
    factor = np.append(np.divide(ideal, bent, out=np.ones(TABLE), where=bent > 0), np.nan)
    grid = _separable(k, x, y)
    place = np.hypot(grid[..., 0], grid[..., 1]) * ((TABLE - 1) / widest)
    before = np.minimum(place, TABLE - 1).astype(np.int32)
    place -= before
    grid *= (factor[before] * (1 - place) + factor[before + 1] * place)[..., None]
    return grid


def _undistorted(k: Intrinsics, x: Array, y: Array) -> Array:
    distorted = _separable(k, x, y)
    return k.undistort(distorted.reshape(-1, 2)).reshape(distorted.shape)


def _spline(k: Intrinsics, x: Array, y: Array) -> Array | None:
    """The grid by interpolation, or None where the model is not smooth or defined all over."""
    if min(len(x), len(y)) < 8:
        return None
    at_x, at_y = np.linspace(0, k.width, NODES), np.linspace(0, k.height, NODES)
    nodes = _undistorted(k, at_x, at_y)
    if not np.isfinite(nodes).all():
        return None
    from scipy.interpolate import RectBivariateSpline  # noqa: PLC0415 - slow to load

    parts = [RectBivariateSpline(at_y, at_x, nodes[..., i])(y, x) for i in (0, 1)]
    grid = np.stack(parts, axis=-1)
    return grid if _spline_error_px(k, x, y, grid) < SPLINE_TOLERANCE_PX else None


def _spline_error_px(k: Intrinsics, x: Array, y: Array, grid: Array) -> float:
    """Largest distance from where pixels between the nodes and along the border should be."""
    i = np.unique(np.linspace(0, len(x) - 1, 2 * NODES + 1).astype(int))
    j = np.unique(np.linspace(0, len(y) - 1, 2 * NODES + 1).astype(int))
    ideal = grid[np.ix_(j, i)]
    back = k.distort(ideal.reshape(-1, 2)).reshape(ideal.shape)
    error = np.abs(back - _separable(k, x[i], y[j])).max(initial=0)
    return float(error * max(k.fx, k.fy)) if np.isfinite(error) else float("inf")
