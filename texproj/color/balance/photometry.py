"""What each photo's light needs so that all agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.color.balance.corrections import Correction, Gains, no_gains
from texproj.color.balance.exposure import LightFit, solve_light
from texproj.color.balance.overlaps import Overlaps, overlaps
from texproj.color.balance.shared_points import SharedPoints
from texproj.color.balance.vignetting import LensLight, lens_lights, lenses_of, light_grid
from texproj.options import ColorOptions


@dataclass(frozen=True, eq=False)
class Photometry:
    """The corrections of all photos, and what the report says of them.

    lenses: the light of each lens that was looked at; exposure_off: (p,) stops that a photo's gain
    is away from what its EXIF exposure calls for, NaN = unknown.
    """

    corrections: tuple[Correction, ...]
    gains: Gains
    lenses: tuple[LensLight, ...]
    exposure_off: Doubles


def solve_photometry(shared: SharedPoints, options: ColorOptions) -> Photometry:
    """Corrections of light from what the photos say about the same points."""
    photos = len(shared.shots)
    if not options.gains:
        gains = no_gains(photos)
        return Photometry(tuple(map(Correction, gains.factor)), gains, (), np.full(photos, np.nan))
    seen = overlaps(shared)
    fit, lights = _fitted(seen, shared, options)
    gains = _gains(seen, fit)
    corrections = [Correction(gain) for gain in gains.factor]
    for light in lights:
        for photo in light.photos if light.corrected else ():
            shot = shared.shots[photo]
            assert shot is not None
            corrections[photo] = Correction(gains.factor[photo], light_grid(light, shot.camera))
    return Photometry(tuple(corrections), gains, tuple(lights), fit.exposure_off / np.log(2))


def _fitted(
    seen: Overlaps, shared: SharedPoints, options: ColorOptions
) -> tuple[LightFit, list[LensLight]]:
    """The light of the photos, and of each lens that was looked at."""
    exposure, none = log_exposure(shared), np.full(len(shared.shots), -1)
    straight = solve_light(seen, none, exposure)
    lens = none if options.vignetting == "off" else lenses_of(shared.shots)
    if lens.max(initial=-1) < 0 or not len(seen.photo):
        return straight, []
    bent = solve_light(seen, lens, exposure)
    lights = lens_lights(seen, lens, bent, straight, options.vignetting == "auto")
    corrected = np.array([light.corrected for light in lights])
    if not corrected.any():
        return straight, lights
    if corrected.all():
        return bent, lights
    kept = np.where(corrected, np.cumsum(corrected) - 1, -1)
    return solve_light(seen, np.where(lens >= 0, kept[lens], -1), exposure), lights


def log_exposure(shared: SharedPoints) -> Doubles:
    """(p,) log of the light that the photos gathered according to EXIF, NaN = unknown."""
    ev = [shot.info.exposure_ev if shot and shot.info else None for shot in shared.shots]
    return np.array([np.nan if value is None else value * np.log(2) for value in ev])


def _gains(seen: Overlaps, fit: LightFit) -> Gains:
    spread = [
        float(np.median(fit.residual[seen.photo == photo])) if count else 0.0
        for photo, count in enumerate(seen.count)
    ]
    factor = np.exp(fit.log_gain).astype(np.float32)
    return Gains(factor, np.array(spread, np.float32), seen.count)
