"""Light that a lens loses towards the corners: which photos share a lens, and whether what was
found can be believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera
from texproj.color.balance.exposure import POWERS, LightFit
from texproj.color.balance.overlaps import Overlaps
from texproj.color.balance.shared_points import Shot

SAME_FOCAL = 0.03
"""Relative difference of focal lengths up to which photos may be of one lens: what a registration
of each photo alone leaves."""

FEWEST = 3
"""Photos of a lens from which on it is looked at: with fewer it cannot be checked."""

SEEN = 300
"""Observations of shared points from which on a lens can be sure: with a few dozen, noise alone has
passed for vignetting."""

SURE = 3.0
"""Standard deviations from none that light at the corners must be."""

LEAST = 0.02
"""Log light at the corners under which there is nothing to correct."""

RISE = 0.01
"""Log light by which a lens may seem to get brighter outwards: noise of the polynomial."""

MOST = 2.0
"""Log light at the corners beyond which it is no lens: two diaphragms are 1.4."""

BETTER = 0.95
"""Part of the median disagreement between photos that may be left for the correction to be made
unasked. Else the model keeps to what photos look like: on the fountain about a fifth of the light
is missing at the corners of all photos (known at 2.9 deviations), which explains 3 % of their
differences; corrected, the model matches other photos, as dark at their corners, worse (31.6
against 32.3 dB), though it is truer (32.7 against 32.2 dB once those are corrected as well)."""

REACHED = 0.99
"""Part of the observations that lie within the radius up to which the lens is known."""

GRID = 48
"""Nodes of a grid of light along the picture's longer side: bilinear between them, the light of a
lens that loses half of it in the corners is off by less than 0.1 %."""


@dataclass(frozen=True, eq=False)
class LensLight:
    """The light of one lens.

    photos: (k,) that are of it; coefficients: (POWERS,) of the log light in r^2, r^4, ..., r in
    half diagonals; reach: radius up to which it was seen, constant beyond; corner: factor on the
    light there; sigma: standard deviation of its logarithm; left: part of the disagreement between
    the photos that is left with it; corrected: whether it is.
    """

    photos: NDArray[np.intp]
    coefficients: Doubles
    reach: float
    corner: float
    sigma: float
    left: float
    corrected: bool


def lenses_of(shots: Sequence[Shot | None]) -> NDArray[np.intp]:
    """(p,) number of each photo's lens, -1 where fewer than `FEWEST` photos share it.

    One lens: the same camera body and picture size, focal lengths that are close.
    """
    kinds: dict[tuple[str, int, int], list[tuple[float, int]]] = {}
    for number, shot in enumerate(shots):
        if shot is not None:
            width, height = sorted((shot.camera.width, shot.camera.height))
            body = shot.info.camera_body if shot.info else ""
            focal = float(np.log(shot.camera.intrinsics.fx))
            kinds.setdefault((body, width, height), []).append((focal, number))
    groups: list[list[int]] = []
    for kind in kinds.values():
        before = -np.inf
        for focal, number in sorted(kind):
            if focal - before > SAME_FOCAL:
                groups.append([])
            groups[-1].append(number)
            before = focal
    out = np.full(len(shots), -1, np.intp)
    for lens, group in enumerate(group for group in groups if len(group) >= FEWEST):
        out[group] = lens
    return out


def lens_lights(
    seen: Overlaps, lens: NDArray[np.intp], bent: LightFit, straight: LightFit, wary: bool
) -> list[LensLight]:
    """What was found of each lens, judged, from fits with and without the lenses.

    wary: correct only where the photos disagree less by it.
    """
    return [
        _judged(number, seen, lens, bent, straight, BETTER if wary else np.inf)
        for number in range(len(bent.log_light))
    ]


def _judged(
    number: int,
    seen: Overlaps,
    lens: NDArray[np.intp],
    bent: LightFit,
    straight: LightFit,
    most: float,
) -> LensLight:
    mine = lens[seen.photo] == number
    reach = float(np.sqrt(np.quantile(seen.squared_radius[mine], REACHED))) if mine.any() else 0.0
    coefficients, corner = bent.log_light[number], _powers(np.array([reach]))[0]
    sigma = float(np.sqrt(corner @ bent.scatter[number] @ corner))
    log_light = _powers(np.linspace(0, reach, 50)) @ coefficients
    falling = bool((log_light - np.minimum.accumulate(log_light) < RISE).all())
    loss = -float(log_light[-1])
    before, after = (np.median(fit.residual[mine]) if mine.any() else 1 for fit in (straight, bent))
    left = float(after / max(before, 1e-9))
    enough = int(mine.sum()) >= SEEN and sigma > 0
    sure = enough and falling and max(LEAST, SURE * sigma) < loss < MOST
    photos = np.flatnonzero(lens == number)
    return LensLight(
        photos, coefficients, reach, float(np.exp(-loss)), sigma, left, sure and left <= most
    )


def light_grid(light: LensLight, camera: Camera) -> Floats:
    """(h, w) float32 factor on the light that takes the lens's away."""
    k = camera.intrinsics
    scale = GRID / max(k.width, k.height)
    width, height = (max(2, round(size * scale)) for size in (k.width, k.height))
    x = (np.arange(width) + 0.5) * k.width / width - k.cx
    y = (np.arange(height) + 0.5) * k.height / height - k.cy
    radius = np.hypot(x, y[:, None]) / (np.hypot(k.width, k.height) / 2)
    log_light = _powers(np.minimum(radius, light.reach).ravel()) @ light.coefficients
    return np.exp(-log_light).reshape(radius.shape).astype(np.float32)


def _powers(radius: Doubles) -> Doubles:
    """(n, POWERS) of radii (n,)."""
    return (radius**2)[:, None] ** np.arange(1, POWERS + 1)
