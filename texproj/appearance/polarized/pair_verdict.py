"""Whether a polarized flash is to be believed: crossed photos that were held out are predicted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.appearance.flash.observations import Observations
from texproj.appearance.prediction import LEAST_GAIN_DB, HeldPhotos, exposed, psnr
from texproj.arrays import Floats

FEWEST = 200
"""Observations of held-out photos below which nothing is told."""


@dataclass(frozen=True)
class PairVerdict(HeldPhotos):
    """Of crossed photos."""

    @property
    def refusal(self) -> str:
        """Why it is refused, in one sentence; empty where it is not."""
        if self.accepted:
            return ""
        return (
            f"the flash does not explain the crossed photos: those held out are predicted by"
            f" {self.lit_db:.1f} dB, by plain colors {self.plain_db:.1f} and {LEAST_GAIN_DB:.1f}"
            " more are asked for; photograph in a dark room, and say in [light] `position` where"
            " the flash is, or leave `position` out where lamps stand still"
        )


def judged_pairs(test: Observations, plain: Floats, lit: Floats, photos: int) -> PairVerdict:
    """The verdict on predictions (m, 3) of the observations of held-out photos."""
    if len(test.point) < FEWEST:
        return PairVerdict(False, 0.0, 0.0, photos)
    shown = test.rgb.astype(np.float64)
    decibels = [
        psnr(shown, exposed(shown, told.astype(np.float64), test.photo)) for told in (plain, lit)
    ]
    gain = decibels[1] - decibels[0]
    return PairVerdict(bool(gain >= LEAST_GAIN_DB), decibels[0], decibels[1], photos)
