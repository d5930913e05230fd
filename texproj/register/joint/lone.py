"""A photo whose camera contradicts the others: found by its ties, and sought again from them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from texproj.arrays import Bools, Doubles
from texproj.camera import Camera
from texproj.register.joint.patches import Density
from texproj.register.joint.search import Level, Pair, TieFinder
from texproj.register.joint.session import Cameras
from texproj.register.joint.ties import TieSearch
from texproj.solve.joint import Ties
from texproj.solve.pnp import MsacOptions, msac_pose

LEAST_SUPPORT = 0.15
"""A photo stands alone if no partner confirms at least this share of its patches."""
LEAST_SOUGHT = 20
"""Patches sought, or ties, below which nothing is concluded."""
LONE_PX, LONE_FACTOR = 0.25, 4.0
"""A photo stands alone if with half of its partners it is off by so many working pixels, and by so
many times more than the usual photo. Real scenes: .01 to .04, a photo out of focus .12."""
WIDE_RADIUS_PX = 16
WIDE_DENSITY = Density(24, 200)
"""The wide search, at half the working size: it reaches 130 pixels of a photo of 3000."""
WIDE_THRESHOLD_PX = 2.0
"""Distance, pixels of the wide search, up to which a tie agrees with a camera."""
LEAST_SHARE = 0.3
"""Of the ties of the wide search that must agree on the camera: chance gives a tenth."""
REMEDY = "pick 8 points in it, or check its picks or its start where it has them"


def best_support(found: Mapping[Pair, TieSearch]) -> dict[int, float]:
    """By photo, the largest share of patches that a partner confirms; photos of which too little
    could be sought are not in it.
    """
    best: dict[int, float] = {}
    for pair, search in found.items():
        if search.sought >= LEAST_SOUGHT:
            for k in pair:
                best[k] = max(best.get(k, 0.0), search.support)
    return best


def confirmed(found: Mapping[Pair, TieSearch]) -> set[int]:
    """Photos of which at least one partner shows the same surface at the same place."""
    return {k for k, share in best_support(found).items() if share >= LEAST_SUPPORT}


def unconfirmed(found: Mapping[Pair, TieSearch], fixed: Bools) -> list[tuple[int, str]]:
    """The photos whose surface no partner confirms, the least confirmed first, and the reasons.

    Their partners must be credible: another photo confirms one of them.
    """
    best, credible = best_support(found), confirmed(found)
    beside = {k for pair in found if credible & set(pair) for k in pair}
    suspects = [k for k in best if k not in credible and not fixed[k] and k in beside]
    return [
        (
            k,
            "no other photo shows the same surface where this camera sees it (at best "
            f"{best[k]:.0%} of the patches agree); {REMEDY}",
        )
        for k in sorted(suspects, key=lambda k: best[k])
    ]


def contradicted(ties: Ties, apart_px: Doubles, fixed: Bools) -> list[tuple[int, str]]:
    """The photos whose ties with one partner contradict those with another, the worst first, and
    the reasons.

    apart_px: (n, 2) where each tie was found less where the solved cameras put it, working pixels.
    Of each pair the median counts: what blur and noise scatter is around zero.
    """
    pairs, which = np.unique(np.stack([ties.to, ties.source], axis=1), axis=0, return_inverse=True)
    bias: dict[int, list[float]] = {k: [] for k in range(len(fixed)) if not fixed[k]}
    order = np.argsort(which, kind="stable")
    of_pair = np.split(apart_px[order], np.searchsorted(which[order], np.arange(1, len(pairs))))
    for pair, own in zip(pairs.tolist(), of_pair, strict=True) if len(pairs) else ():
        if len(own) >= LEAST_SOUGHT:
            length = float(np.linalg.norm(np.nanmedian(own, axis=0)))
            for k in set(pair) & bias.keys():
                bias[k].append(length)
    median = {k: float(np.median(lengths)) for k, lengths in bias.items() if lengths}
    if not median:
        return []
    usual = float(np.median([*median.values()]))
    bad = [k for k in median if median[k] > max(LONE_PX, LONE_FACTOR * usual)]
    return [
        (
            k,
            f"what it shares with one photo contradicts what it shares with another, by "
            f"{median[k] / usual:.0f} times as much as usual; {REMEDY}",
        )
        for k in sorted(bad, key=lambda k: -median[k])
    ]


def far_apart(lone: Sequence[tuple[int, str]], pairs: Collection[Pair]) -> list[tuple[int, str]]:
    """Those of which none is compared with another, nor with a partner of another, the first first:
    what is wrong with one of them cannot come from another. Of few photos that is one alone.
    """
    partners: dict[int, set[int]] = {}
    for i, j in pairs:
        partners.setdefault(i, {i}).add(j)
        partners.setdefault(j, {j}).add(i)
    chosen: list[tuple[int, str]] = []
    near: set[int] = set()
    for k, reason in lone:
        around = partners.get(k, {k})
        if not around & near:
            chosen.append((k, reason))
            near |= around
    return chosen


def sought_again(
    k: int, cameras: Cameras, partners: Collection[int], finder: TieFinder,
    points: Sequence[Doubles], working_px: int,
) -> Camera | None:  # fmt: skip
    """The camera of photo k, full size, from what its partners show, found in a wide neighborhood;
    None if it is not found there. points: as `TieFinder.find` takes them.
    """
    level = Level(working_px // 2, WIDE_DENSITY)
    pairs = [(k, j) for j in sorted(partners)]
    if not pairs:
        return None
    found = finder.find(cameras, pairs, level, WIDE_RADIUS_PX, points)
    ties = Ties.joined([one.ties for one in found.values()])
    if len(ties) < LEAST_SOUGHT:
        return None
    full = cameras[k]
    threshold = WIDE_THRESHOLD_PX * max(1.0, max(full.width, full.height) / level.longest)
    fit = msac_pose(ties.to_px, ties.point, full.intrinsics, MsacOptions(threshold))
    if fit is None or fit.inliers.sum() < max(LEAST_SOUGHT, LEAST_SHARE * len(ties)):
        return None
    return Camera(full.intrinsics, fit.pose)
