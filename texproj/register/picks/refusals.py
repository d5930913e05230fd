"""Picks that cannot give a camera, each refused with a sentence that says what to add."""

from __future__ import annotations

from math import lgamma, log, pi

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.errors import RegistrationError
from texproj.photo import Correspondences, PhotoInfo
from texproj.register.picks.search import Candidate
from texproj.solve.robust import Estimate

FALSE_ALARMS = 1e-2
"""Largest expected number of chance agreements as good as the one found (a contrario: Moisan,
Stival, "A probabilistic criterion to detect rigid point matches", IJCV 2004)."""

LINE = 0.03
"""Picks are on a line if their second extent is below this part of the first."""

PLANE = 0.01
"""Picks are in a plane if their third extent is below this part of the first."""

PLANAR_FOCAL_SIGMA = 0.03
"""A plane seen at a slant does give the focal length; less sure than this, it does not."""

RIVAL = 9.2
"""A second camera whose description is longer by less may be the true one: odds of 100 to 1."""

SMALL = 0.05
"""Picks are all in one place if their extent is below this part of the picture's diagonal."""


def refuse_unusable(info: PhotoInfo, picks: Correspondences) -> None:
    """Raise RegistrationError for picks that no camera can be solved from, whatever it is."""
    n = len(picks)
    if n < 4:
        raise RegistrationError(
            f"{info.name}: {n} pick{'s' * (n != 1)}; pick 8 points, well spread over the photo and "
            f"in depth (4 can do where the lens is calibrated)"
        )
    every = np.concatenate([picks.xy_px, picks.xyz_in_world], axis=1)
    finite: NDArray[np.bool_] = np.isfinite(every).all(axis=1)
    if not finite.all():
        raise RegistrationError(
            f"{info.name}: pick {_named(picks, ~finite)} has a coordinate that is not a finite "
            f"number; correct or remove it"
        )
    size = np.array([info.width, info.height])
    outside = ~np.all((picks.xy_px >= 0) & (picks.xy_px <= size), axis=1)
    if outside.any():
        i = int(np.flatnonzero(outside)[0])
        u, v = picks.xy_px[i]
        raise RegistrationError(
            f"{info.name}: pick {_named(picks, outside)} lies outside the photo ({u:g}, {v:g}; the "
            f"photo has {info.width} x {info.height} pixels); correct or remove it"
        )
    _refuse_extent(info, picks, np.ones(n, bool))


def refuse_shape(info: PhotoInfo, picks: Correspondences, best: Candidate) -> None:
    """Raise RegistrationError if the inliers alone are degenerate, or do not give the focal."""
    estimate, free = best.estimate, best.lens.free
    _refuse_extent(info, picks, estimate.inliers)
    extent = _extents(picks.xyz_in_world[estimate.inliers])
    flat = extent[2] < PLANE * extent[0]
    if flat and "focal" in free:
        sigma = estimate.sigma_of(free, "focal")
        if sigma > PLANAR_FOCAL_SIGMA:
            raise RegistrationError(
                f"{info.name}: the {int(estimate.inliers.sum())} picks that fit lie in one plane, "
                f"which leaves the focal length open by {100 * sigma:.0f} %; add at least two "
                f"picks in front of or behind that plane, or give the focal length"
            )


def refuse_too_few(info: PhotoInfo, picks: Correspondences, best: Candidate) -> None:
    """Raise RegistrationError if chance could make as many picks agree as well."""
    estimate = best.estimate
    k = int(estimate.inliers.sum())
    farthest = float(estimate.distance_px[estimate.inliers].max())
    reach = max(farthest, 2 * estimate.sigma_px)
    chance = log(min(1.0, pi * reach**2 / (info.width * info.height)))
    sample = 3 + 0.5 * len(best.lens.free)
    alarms = _log_comb(len(picks), k) + _log_comb(k, 3) + log(4) + chance * (k - sample)
    if k < 4 or alarms > log(FALSE_ALARMS):
        raise RegistrationError(
            f"{info.name}: only {k} of {len(picks)} picks agree with one camera, which chance "
            f"could do as well; check the picks ({_named(picks, ~estimate.inliers)} fit worst) "
            f"and add more"
        )


def refuse_rival(
    info: PhotoInfo, candidates: list[Candidate], points: Doubles, limit: float
) -> None:
    """Raise RegistrationError if another camera, which puts the surface elsewhere, is not
    clearly worse."""
    best = candidates[0].estimate
    for rival in candidates[1:]:
        if rival.length - candidates[0].length > RIVAL:
            break
        if not apart_px(best, rival.estimate, points) <= limit:
            raise RegistrationError(
                f"{info.name}: two different cameras fit the picks equally well; add picks that "
                f"stand out in depth from the others, and some {emptiest(info, best)}"
            )


def apart_px(a: Estimate, b: Estimate, points: Doubles) -> float:
    """Root mean square distance between the images of world points in two cameras; inf if one
    does not see them all."""
    apart = a.camera.project(points)[0] - b.camera.project(points)[0]
    mean2 = (apart**2).sum(axis=1).mean()
    return float(np.sqrt(mean2)) if np.isfinite(mean2) else float("inf")


def refuse_uncertain(info: PhotoInfo, estimate: Estimate, error: float, limit: float) -> None:
    """Raise RegistrationError if the camera found is not certain enough."""
    if not error <= limit:
        raise RegistrationError(
            f"{info.name}: the picks leave the surface uncertain by {error:.0f} px (at most "
            f"{limit:.0f} px); add picks {emptiest(info, estimate)}",
            approximate=estimate.camera,
        )


def nothing_fits(info: PhotoInfo, picks: Correspondences) -> str:
    """The sentence for picks that no camera explains."""
    return (
        f"{info.name}: no camera agrees with four or more of the {len(picks)} picks; check that "
        f"pixels and mesh points belong together and that the points lie on this mesh"
    )


def emptiest(info: PhotoInfo, estimate: Estimate) -> str:
    """The ninth of the picture furthest from all picks that fit, in words."""
    xy = (estimate.camera.project(estimate.fit_points)[0]) / (info.width, info.height)
    rows, columns = ("upper", "middle", "lower"), ("left", "middle", "right")
    centers = np.array([[(c + 0.5) / 3, (r + 0.5) / 3] for r in range(3) for c in range(3)])
    distance = np.linalg.norm(centers[:, None] - xy[None], axis=2).min(axis=1)
    r, c = divmod(int(np.argmax(distance)), 3)
    if (r, c) == (1, 1):
        return "in the middle of the photo"
    if c == 1:
        return f"in the {rows[r]} part of the photo"
    if r == 1:
        return f"on the {columns[c]} of the photo"
    return f"in the {rows[r]} {columns[c]} of the photo"


def _refuse_extent(info: PhotoInfo, picks: Correspondences, used: NDArray[np.bool_]) -> None:
    n = int(used.sum())
    which = f"the {n} picks" if used.all() else f"the {n} picks that fit"
    solid, flat = _extents(picks.xyz_in_world[used]), _extents(picks.xy_px[used])
    where = _away_from(info, picks.xy_px[used])
    if solid[1] < LINE * solid[0] or flat[1] < LINE * flat[0]:
        raise RegistrationError(
            f"{info.name}: {which} lie on one line; add at least one pick away from it, e.g. "
            f"{where}"
        )
    if flat[0] * np.sqrt(12) < SMALL * np.hypot(info.width, info.height):
        raise RegistrationError(
            f"{info.name}: {which} are all in one small part of the photo; add picks far from "
            f"them, e.g. {where}"
        )


def _away_from(info: PhotoInfo, xy: Doubles) -> str:
    """The quarter of the picture whose center is furthest from the line through the picks."""
    center = xy.mean(axis=0)
    across = np.linalg.svd(xy - center)[2][1]
    names = {"upper left": (0.25, 0.25), "upper right": (0.75, 0.25),
             "lower left": (0.25, 0.75), "lower right": (0.75, 0.75)}  # fmt: skip
    size = np.array([info.width, info.height])

    def far(name: str) -> float:
        away = np.array(names[name]) * size - center
        return float(abs(away @ across) + 0.1 * np.linalg.norm(away))

    return f"in the {max(names, key=far)} of the photo"


def _extents(points: Doubles) -> Doubles:
    """Standard deviations along the principal axes, largest first."""
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    out: Doubles = np.zeros(3)
    out[: len(singular)] = singular / np.sqrt(len(points))
    return out


def _named(picks: Correspondences, chosen: NDArray[np.bool_]) -> str:
    return ", ".join(name for name, c in zip(picks.names, chosen, strict=True) if c) or "none"


def _log_comb(n: int, k: int) -> float:
    return lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)
