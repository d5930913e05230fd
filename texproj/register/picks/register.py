"""The camera of a photo from picked pairs of pixels and mesh points."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Intrinsics, Pose
from texproj.errors import RegistrationError
from texproj.options import PointsOptions
from texproj.photo import Correspondences, PhotoInfo
from texproj.records import Fit
from texproj.register.picks import refusals as check
from texproj.register.picks.expected_error import expected_error_px, surface_points
from texproj.register.picks.lens import Lens, lens_guess
from texproj.register.picks.search import Candidate, Search

DEFAULTS = PointsOptions()

WRONG_ODDS = 0.01
"""Odds, before looking at the picks, that a lens in cameras.json or EXIF is not the photo's."""

STEP = 4.6
"""Description length that each further group of unknowns must save: odds of 10 to 1."""

SUSPICIOUS_NOISE, SUSPICIOUS_OUTLIERS = 1.5, 0.4
"""Noise above this multiple of the usual one, or a larger share of outliers, makes the search
start anew without the focal length."""


def register_points(
    info: PhotoInfo,
    picks: Correspondences,
    prior: Intrinsics | None = None,
    options: PointsOptions = DEFAULTS,
    start: Pose | None = None,
    surface: Doubles | None = None,
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
    fit, refusal = examine_points(info, picks, prior, options, start, surface)
    if refusal is not None:
        raise refusal
    assert fit is not None
    return fit


def examine_points(
    info: PhotoInfo,
    picks: Correspondences,
    prior: Intrinsics | None = None,
    options: PointsOptions = DEFAULTS,
    start: Pose | None = None,
    surface: Doubles | None = None,
) -> tuple[Fit | None, RegistrationError | None]:
    """What `register_points` finds, and why it refuses it if it does. What is refused is the camera
    that comes nearest, to show how far off each pick is: not accepted, its error unknown; None
    where no camera comes near.
    """
    try:
        check.refuse_unusable(info, picks)
    except RegistrationError as error:
        return None, error
    search = Search(info, picks, options, start)
    lens = lens_guess(info, prior, options)
    candidates = search.candidates(lens)
    rival = None
    if lens.checked:
        candidates, rival = _overruled(search, lens, candidates)
    if not candidates:
        return None, RegistrationError(check.nothing_fits(info, picks))
    try:
        return _judged(search, lens, candidates, rival, surface), None
    except RegistrationError as error:
        nearest = _fit(picks, candidates[0], float("inf"), "")
        return replace(nearest, accepted=False, reason=str(error)), error


def _overruled(
    search: Search, lens: Lens, found: list[Candidate]
) -> tuple[list[Candidate], Candidate | None]:
    """The candidates under the looser model of the lens that explains the picks far better, or
    `found` if none does, with the best of those that were not believed.
    """
    first, *more = lens.looser()
    starts = [c.estimate.camera for c in found[:2]]
    if not found or _suspicious(search, found[0]):
        starts += [c.estimate.camera for c in search.candidates(first)[:3]]
    tried = search.worked_out(first, starts)
    near = [c.estimate.camera for c in (*tried[:1], *found[:1])]
    looser = tried
    for model in more:
        other = search.worked_out(model, near)
        if other and (not looser or other[0].length + STEP < looser[0].length):
            looser = other
    if looser and (not found or wrong_chance(found[0], looser[0]) > 0.5):
        return looser, None
    return found, (looser[0] if looser else None)


def _suspicious(search: Search, best: Candidate) -> bool:
    e = best.estimate
    noisy = e.sigma_px > SUSPICIOUS_NOISE * search.noise.nominal_px
    return bool(noisy or (~e.inliers).mean() > SUSPICIOUS_OUTLIERS)


def wrong_chance(given: Candidate, looser: Candidate) -> float:
    """Probability that the looser model of the lens is the true one, given the picks."""
    odds = WRONG_ODDS * np.exp(np.clip((given.length - looser.length) / 2, -50, 50))
    return float(odds / (1 + odds))


def _error_with_rival_px(best: Candidate, rival: Candidate | None, points: Doubles) -> float:
    """Expected error, with the chance that the lens is the rival's and not the one given."""
    error = expected_error_px(best.estimate, best.lens.free, points)
    if rival is None:
        return error
    chance = wrong_chance(best, rival)
    other = expected_error_px(rival.estimate, rival.lens.free, points)
    apart = check.apart_px(best.estimate, rival.estimate, points)
    return float(np.sqrt((1 - chance) * error**2 + chance * (other**2 + apart**2)))


def _judged(
    search: Search,
    lens: Lens,
    candidates: list[Candidate],
    rival: Candidate | None,
    surface: Doubles | None,
) -> Fit:
    """The best candidate as a Fit, if nothing speaks against it."""
    info, picks, best = search.info, search.picks, candidates[0]
    points = surface_points(best.estimate, surface)
    error = _error_with_rival_px(best, rival, points)
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
    solved = ", ".join(best.lens.free)
    return (
        f"the picks contradict the given lens; solved: {solved} (focal length {before:.0f} px -> "
        f"{after:.0f} px)"
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
