"""How well what was left out of a fit is predicted: what every verdict on a light says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles, Index
from texproj.photo import srgb_from_linear

LEAST_GAIN_DB = 1.0
"""Better than plain colors by which a light is believed: noise and odd paint give a few tenths by
chance.
"""


@dataclass(frozen=True)
class Prediction:
    """accepted: whether the light is believed; plain_db, lit_db: how well what was left out of the
    fit is predicted by plain colors alone, and with the light; PSNR as shown (sRGB), dB.
    """

    accepted: bool
    plain_db: float
    lit_db: float

    @property
    def gain_db(self) -> float:
        """How much better the light predicts."""
        return self.lit_db - self.plain_db


def psnr(truth: Doubles, found: Doubles) -> float:
    """Decibels between linear colors, compared as they are shown (sRGB)."""
    shown = [srgb_from_linear(np.clip(rgb, 0, 1)) for rgb in (truth, found)]
    return float(-10 * np.log10(np.mean(np.square(shown[0] - shown[1])) + 1e-12))


@dataclass(frozen=True)
class HeldPhotos(Prediction):
    """Of photos that were held out, each one's exposure free. photos: how many these were."""

    photos: int


def exposed(shown: Doubles, told: Doubles, photo: Index) -> Doubles:
    """Predictions (m, 3) of what is shown, each photo's (m,) at its best exposure."""
    out = told.astype(np.float64)
    for number in np.unique(photo):
        rows = photo == number
        out[rows] *= np.median(shown[rows].sum(axis=1) / np.maximum(told[rows].sum(axis=1), 1e-6))
    return out
