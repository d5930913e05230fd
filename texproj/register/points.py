"""The camera of a photo from picked pairs of pixels and mesh points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Intrinsics, Pose
from texproj.errors import RegistrationError
from texproj.options import PointsOptions
from texproj.photo import Correspondences, PhotoInfo
from texproj.records import Fit
from texproj.register import picks as check
from texproj.register.doubt import expected_error_px, surface_points
from texproj.register.lens import Lens, lens_guess
from texproj.register.search import Candidate, Search

Array = NDArray[np.float64]

DEFAULTS = PointsOptions()

OVERRULE = 14.0
"""Drop of the description length at which picks overrule what was said of the lens: odds of
1000 to 1."""

SUSPICIOUS = 1.5
"""Noise above this multiple of the usual one makes the search start again without the focal."""


def register_points(
    info: PhotoInfo,
    picks: Correspondences,
    prior: Intrinsics | None = None,
    options: PointsOptions = DEFAULTS,
    start: Pose | None = None,
    surface: Array | None = None,
) -> Fit:
    """The camera that the picks see.

    prior: intrinsics of cameras.json, trusted unless `options.focal` says otherwise or the picks
    contradict them; without it the focal length of EXIF, else a usual one, is the first guess.
    start: a pose to try besides those found from the picks.
    surface: (m, 3) world points, e.g. the mesh's vertices, over whose image, where it falls inside
    the picture, the expected error is averaged; without it, the box that the picks span in the
    picture and in depth, a quarter larger on each side.

    Raises RegistrationError with one sentence that says which points to add.
    """
    check.refuse_unusable(info, picks)
    search = Search(info, picks, options, start)
    lens = lens_guess(info, prior, options)
    candidates = search.candidates(lens)
    if lens.checked:
        candidates = _overruled(search, lens, candidates)
    if not candidates:
        raise RegistrationError(check.nothing_fits(info, picks))
    return _judged(search, lens, candidates, surface)


def _overruled(search: Search, lens: Lens, found: list[Candidate]) -> list[Candidate]:
    """The candidates under the first looser model of the lens that explains the picks far better,
    or `found` if none does.
    """
    best = found[0].estimate if found else None
    starts = [c.estimate.camera for c in found]
    limit = SUSPICIOUS * search.noise.nominal_px
    if best is None or not best.inliers.all() or best.sigma_px > limit:
        starts += [c.estimate.camera for c in search.candidates(lens.looser()[0])]
    for model in lens.looser():
        others = search.worked_out(model, starts)
        if others and (not found or others[0].length + OVERRULE < found[0].length):
            found = others
    return found


def _judged(search: Search, lens: Lens, candidates: list[Candidate], surface: Array | None) -> Fit:
    """The best candidate as a Fit, if nothing speaks against it."""
    info, picks, best = search.info, search.picks, candidates[0]
    points = surface_points(best.estimate, surface)
    error = expected_error_px(best.estimate, best.lens.free, points)
    limit = search.options.max_error_percent / 100 * search.side
    check.refuse_too_few(info, picks, best)
    check.refuse_shape(info, picks, best)
    check.refuse_rival(info, candidates, points, limit)
    check.refuse_uncertain(info, best.estimate, error, limit)
    return _fit(picks, best, error, _lens_note(lens, best))


def _lens_note(given: Lens, best: Candidate) -> str:
    """What to tell about a lens that was not believed."""
    if best.lens.free == given.free and best.lens.trust == given.trust:
        return ""
    before, after = given.intrinsics.fx, best.estimate.camera.intrinsics.fx
    return (
        f"the picks contradict the given lens (focal length {before:.0f} px), which was solved: "
        f"{after:.0f} px"
    )


def _fit(picks: Correspondences, best: Candidate, error: float, note: str) -> Fit:
    e, free = best.estimate, best.lens.free
    outliers = [name for name, good in zip(picks.names, e.inliers, strict=True) if not good]
    reasons = [note] if note else []
    if outliers:
        reasons.append(f"picks that do not fit and were left out: {', '.join(outliers)}")
    quality: dict[str, Any] = {
        "picks": len(picks), "inliers": int(e.inliers.sum()), "outliers": outliers,
        "pick_sigma_px": e.sigma_px, "solved": list(free),
        "focal_px": e.camera.intrinsics.fx, "iterations": e.fit.iterations,
        "initial_cost": e.fit.initial_cost, "cost": e.fit.cost, "stop": e.fit.stop,
    }  # fmt: skip
    if "focal" in free:
        quality["focal_sigma_percent"] = 100 * e.sigma_of(free, "focal")
    return Fit(
        e.camera, "points", error, e.distance_px, e.inliers, e.covariance,
        ("rotation", "translation", *free), picks.names,
        reason="; ".join(reasons), quality=quality,
    )  # fmt: skip
