"""Why one photo's view of a point counts more than another's: named factors in 0..1.

After the masks of Callieri, Cignoni, Corsini, Scopigno, "Masked photo blending", Computers &
Graphics 2008; the formulas are ours.
"""

from __future__ import annotations

import numpy as np

from texproj.color.points import Floats
from texproj.color.sight import Sight
from texproj.color.view import PhotoView, lookup
from texproj.options import ColorOptions

FLOOR = np.float32(0.01)
"""What a doubtful but visible sample keeps: it yields to every better one, yet colors a point
that has no better one."""


def factors_at(sight: Sight, view: PhotoView, options: ColorOptions) -> dict[str, Floats]:
    """Each (m,) float32 factor by name.

    angle: cosine between normal and line of sight; density: pixels of the photo per point,
    saturated at one; border and silhouette: distance from the picture's edge and from the next
    depth discontinuity, ramps over `border_feather` and `silhouette_feather`; mask: the same for
    the user's stencil, and exactly 0 on it.
    """
    factors = {
        "angle": sight.cos_angle ** np.float32(options.angle_power),
        "density": np.minimum(sight.pixels**2 / sight.cos_angle, 1)
        ** np.float32(options.density_power),
        "border": border_factor(sight, view, options.border_feather),
        "silhouette": silhouette_factor(sight, view, options.silhouette_feather),
    }
    if view.mask_px is not None:
        factors["mask"] = mask_factor(sight, view, options.mask_feather)
    return factors


def border_factor(sight: Sight, view: PhotoView, feather: float) -> Floats:
    """Ramp from the picture's edge inwards; `feather` is a part of the picture's diagonal."""
    size = np.float32((view.camera.width, view.camera.height))
    inside = np.minimum(sight.xy_px, size - sight.xy_px).min(axis=1)
    return _ramp(inside, feather * view.diagonal_px)


def silhouette_factor(sight: Sight, view: PhotoView, feather: float) -> Floats:
    """Ramp from the next depth discontinuity; `feather` is a part of the picture's diagonal."""
    erode = view.depth_pixel
    distance = lookup(view.silhouette_px, sight.depth_xy) - np.float32(erode)
    return _ramp(distance, feather * view.diagonal_px)


def mask_factor(sight: Sight, view: PhotoView, feather: float) -> Floats:
    """Ramp from the stencil's edge, 0 on the stencil itself and one pixel around it."""
    assert view.mask_px is not None
    distance = lookup(view.mask_px, sight.xy_px) - np.float32(1)
    ramp = np.clip(distance / np.float32(max(feather * view.diagonal_px, 1e-3)), 0, 1)
    return ramp.astype(np.float32)


def _ramp(distance: Floats, length: float) -> Floats:
    """Smooth 0..1 over `length`, never under `FLOOR`."""
    t = np.clip(distance / np.float32(max(length, 1e-3)), 0, 1)
    return np.maximum(t * t * (3 - 2 * t), FLOOR)
