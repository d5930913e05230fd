"""Whether what was found under the flash is to be believed: photos that were held out of the fit
are predicted, and again by plain colors and by matte ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.appearance.flash.closed_form import fit_each, fit_lambert, labelled_terms, predicted
from texproj.appearance.flash.found import HIGHLIGHT, Found, photo_gains
from texproj.appearance.flash.observations import Observations
from texproj.appearance.prediction import LEAST_GAIN_DB, Prediction, psnr
from texproj.arrays import Floats

EVERY = 7
"""Of how many photos one is held out."""

FEWEST_PHOTOS = 5
FEWEST = 200
"""Observations of held-out photos below which nothing is told."""


@dataclass(frozen=True)
class FlashVerdict(Prediction):
    """Of photos that were held out, each flash's output free. matte_db: as predicted by a matte
    surface under the flash; highlights: part of the surface that saw its highlight; photos: how
    many were held out.
    """

    matte_db: float
    highlights: float
    photos: int

    @property
    def refusal(self) -> str:
        """Why it is refused, in one sentence; empty where it is not."""
        if self.accepted:
            return ""
        return (
            f"the flash does not explain the photos here: those held out are predicted by"
            f" {self.lit_db:.1f} dB, by plain colors {self.plain_db:.1f} and {LEAST_GAIN_DB:.1f}"
            " more are asked for; photograph in a dark room with the flash as the only light, and"
            " say in [light] `position` where it is"
        )


def held_out(photos: int) -> list[int]:
    """Numbers of the photos that the fit does not see."""
    return list(range(EVERY // 2, photos, EVERY)) if photos >= EVERY else [photos // 2]


def judged(found: Found, held: list[int]) -> FlashVerdict:
    """The verdict on a surface whose materials were found without the held photos, and completed
    with all.
    """
    seen = found.seen
    out = np.isin(seen.photo, held)
    train, test = seen.kept(~out), seen.kept(out & (seen.number >= 4)[seen.point])
    fits = (
        plain_color(train),
        fit_lambert(train).color,
        fit_each(train, found.kinds, found.label).color,
    )
    zero = np.zeros_like(test.rgb)
    slopes = (
        np.ones_like(test.rgb),
        (test.light / np.float32(np.pi))[:, None] + test.around / np.float32(np.pi),
    )
    told = [slope * color[test.point] + zero for slope, color in zip(slopes, fits[:2], strict=True)]
    told.append(predicted(*labelled_terms(test, found.kinds, found.label), test, fits[2]))
    plain, matte, lit = (psnr_at_best_output(test, one, len(found.flashes.cameras)) for one in told)
    known = seen.number > 0
    share = float((seen.nearest_highlight() >= HIGHLIGHT)[known].mean()) if known.any() else 0.0
    good = len(test.point) >= FEWEST and lit - plain >= LEAST_GAIN_DB and lit >= matte
    return FlashVerdict(bool(good), plain, lit, matte, share, len(held))


def plain_color(seen: Observations) -> Floats:
    """(n, 3) mean color of each point in the photos."""
    total = seen.sums(seen.rgb * seen.trust[:, None])
    weight = np.maximum(seen.sums(seen.trust[:, None]), 1e-20)
    return np.divide(total, weight, dtype=np.float32)


def psnr_at_best_output(test: Observations, told: Floats, photos: int) -> float:
    """Decibels as shown (sRGB), of each photo at its best output; 0 without an observation."""
    if not len(test.point):
        return 0.0
    gain = photo_gains(test, told, photos)
    return psnr(test.rgb.astype(float), (told * gain[test.photo, None]).astype(float))
