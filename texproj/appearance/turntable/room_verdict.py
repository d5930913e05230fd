"""Whether the light of a room is to be believed: photos that were held out of the fit are
predicted, and again by colors that no light changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.appearance.prediction import LEAST_GAIN_DB, HeldPhotos, exposed, psnr
from texproj.appearance.sightings import Sightings
from texproj.appearance.turntable.room_fit import albedo_of
from texproj.arrays import Bools, Doubles

EVERY = 7
"""Of how many photos one is held out."""

FEWEST = 300
"""Sightings of held-out photos below which nothing is told."""

OWN_GAIN_DB = 2.0
"""The same where nobody said that the object was turned."""


@dataclass(frozen=True)
class RoomVerdict(HeldPhotos):
    """Of photos of a turned object."""

    @property
    def refusal(self) -> str:
        """Why it is refused, in one sentence; empty where it is not."""
        if self.accepted:
            return ""
        return (
            f"no light that stays beside the camera explains the photos here: those held out are"
            f" predicted by {self.lit_db:.1f} dB, by plain colors {self.plain_db:.1f} and"
            f" {LEAST_GAIN_DB:.1f} more are asked for; turn the object, leave camera and lamps in"
            ' their place, or say kind = "natural" in [light]'
        )


def held_out(photos: int) -> Bools:
    """(p,) which photos the fit does not see."""
    out = np.zeros(photos, bool)
    out[EVERY // 2 if photos >= EVERY else photos // 2 :: EVERY] = True
    return out


def judged(seen: Sightings, irradiance: Doubles, held: Bools, least_db: float) -> RoomVerdict:
    """The verdict on a light that was found without the held photos. irradiance: (m, 3) of all."""
    out = held[seen.photo]
    train = seen.kept(~out)
    test = out & (train.number >= 2)[seen.point]
    plain = np.maximum(albedo_of(train, np.ones_like(train.rgb, np.float64)) / np.pi, 0)
    paint = np.maximum(albedo_of(train, irradiance[~out]) / np.pi, 0)
    shown = seen.rgb[test].astype(np.float64)
    photo, point = seen.photo[test], seen.point[test]
    told = plain[point], paint[point] * irradiance[test]
    if len(shown) < FEWEST:
        return RoomVerdict(False, 0.0, 0.0, int(held.sum()))
    plain_db, lit_db = (psnr(shown, exposed(shown, one, photo)) for one in told)
    accepted = lit_db - plain_db >= least_db
    return RoomVerdict(bool(accepted), plain_db, lit_db, int(held.sum()))
