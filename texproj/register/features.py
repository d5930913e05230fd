"""Registration by other photos: what one photo shows is found in photos that are registered, whose
pixels are points of the mesh. So a few picks in one photo serve all others.

The idea of a graph of photos that spares the user work: Franken et al., "Minimizing user
intervention in registering 2D images to 3D models", The Visual Computer 2005. Automatic: ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.camera import Camera, Intrinsics
from texproj.errors import RegistrationError
from texproj.options import PointsOptions
from texproj.photo import Correspondences, PhotoInfo
from texproj.records import Fit
from texproj.register.picks.register import register_points
from texproj.register.surface_lookup import surface_at
from texproj.solve.features import Features, match_features

MOST_PAIRS = 600
LEAST_INLIERS = 20
LEAST_SHARE = 0.1
"""Of the matches. That chance does not agree so well is checked with the picks; this is against
ornaments that repeat."""


@dataclass(frozen=True, eq=False)
class Known:
    """A registered photo, full size: its camera, its features, the depth of the mesh as it sees it
    at a reduced size, and the expected error of its own registration in pixels.
    """

    camera: Camera
    features: Features
    depth: NDArray[np.float32]
    expected_error_px: float


def register_pairs(
    info: PhotoInfo,
    found: Sequence[Correspondences],
    inherited_px: float,
    prior: Intrinsics | None,
    options: PointsOptions | None = None,
    surface: Doubles | None = None,
) -> Fit:
    """The camera of a photo from what it shares with each of some registered photos.

    inherited_px: what the errors of these make it be off, see `inherited_error`. prior, options,
    surface: as for picked points. Raises RegistrationError.
    """
    pairs = _some(found)
    if len(pairs) < LEAST_INLIERS:
        raise RegistrationError(
            f"only {len(pairs)} points of the photo are found in registered photos; pick 8 points, "
            "or register a photo that shows more of the same"
        )
    try:
        fit = register_points(info, pairs, prior, options or PointsOptions(), surface=surface)
    except RegistrationError:
        raise RegistrationError(
            f"the {len(pairs)} points found in registered photos do not agree on one camera; "
            "pick 8 points"
        ) from None
    return _judged(fit, inherited_px)


def pairs_with(features: Features, other: Known) -> Correspondences:
    """Pixels of a photo with the points of the mesh that a registered one shows there."""
    use, xyz = surface_at(other.camera, other.depth, other.features.xy_px)
    on_surface = Features(other.features.xy_px[use], other.features.descriptors[use])
    matches = match_features(features, on_surface)
    return Correspondences(features.xy_px[matches[:, 0]], xyz[matches[:, 1]])


def _some(found: Sequence[Correspondences]) -> Correspondences:
    """All pairs, or so many of them as are enough."""
    xy = np.concatenate([np.zeros((0, 2)), *(pairs.xy_px for pairs in found)])
    xyz = np.concatenate([np.zeros((0, 3)), *(pairs.xyz_in_world for pairs in found)])
    chosen = np.random.default_rng(0).permutation(len(xy))[:MOST_PAIRS]
    return Correspondences(xy[chosen], xyz[chosen])


def inherited_error(
    found: Sequence[Correspondences], errors_px: Sequence[float], apart: Sequence[bool]
) -> float:
    """How far off, pixels, what is found through registered photos is by their expected errors.

    found: what is shared with each; apart: of each, whether its error is its own, as of picks;
    those of the others are taken to be one error that all share.
    """
    share = np.array([len(pairs) for pairs in found], np.float64)
    parts = share / max(share.sum(), 1.0) * np.array(errors_px)
    own = np.array(apart, bool)
    return float(np.hypot(parts[~own].sum(), np.linalg.norm(parts[own])))


def _judged(fit: Fit, inherited: float) -> Fit:
    """The fit with the others' errors in its own, and the verdict."""
    inliers, share = int(fit.inliers.sum()), float(fit.inliers.mean())
    accepted = inliers >= LEAST_INLIERS and share >= LEAST_SHARE
    reason = "" if accepted else (
        f"only {inliers} of {len(fit.inliers)} points found in registered photos agree; "
        "pick 8 points"
    )  # fmt: skip
    quality = {k: v for k, v in fit.quality.items() if k not in ("outliers", "picks")}
    return replace(
        fit, method="features", names=(), accepted=accepted, reason=reason,
        expected_error_px=float(np.hypot(fit.expected_error_px, inherited)), quality=quality,
    )  # fmt: skip
