"""What is in a photo and not in its crossed partner: mirrored light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Floats, Index
from texproj.photo import LUMINANCE

UNFILTERED = 1.5
"""Photos that are so much brighter than their crossed partners on matte parts were taken without a
filter on the lens: a parallel one passes half of the paint's light, as a crossed one does.
"""

BOTH_FILTERED = 2.0
"""Light that a filter keeps of what paint scatters is half: a mirror loses nothing."""

DARKER = 0.9
"""A photo of less light than its crossed partner, which mirrors cannot be."""

MOST_DARKER = 0.25
"""Part of the sightings that may be darker by mistake: noise, edges."""

BACKWARD = 2.0
"""How much more light may be missing in photos than is there beyond their partners: where little
is mirrored both are noise; in swapped folders highlights are missing.
"""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Sightings that are in both photos of their pair. parallel, crossed: (m,) their rows;
    mirrored: (m, 3) light that was mirrored, of paint of white under the same light 1; darker: part
    of them that are darker in the photo than in its partner; backward: light that is missing there
    over light that is mirrored.
    """

    parallel: Index
    crossed: Index
    mirrored: Floats
    darker: float
    backward: float

    @property
    def refusal(self) -> str:
        """Why the two sets are no pairs; empty where they may be."""
        if len(self.crossed) and self.darker <= MOST_DARKER and self.backward <= BACKWARD:
            return ""
        if not len(self.crossed):
            return "the crossed photos show nothing that their partners show: are they pairs?"
        return (
            "highlights are in photos-crossed/ and not in photos/, or these are darker as a whole:"
            " swap the folders, or take both with one exposure, or one that EXIF tells"
        )


Shown = tuple[Index, Index, Floats]
"""Point (m,), photo (m,) and linear rgb (m, 3) of sightings."""


def paired(parallel: Shown, crossed: Shown, exposure: Floats, each: bool) -> Pairs:
    """Pairs of sightings.

    exposure: (p,) by how much more light each crossed photo gathered than its partner; each: every
    pair has a factor of its own, as flashes do, which is told by what no highlight reaches; light
    from all sides mirrors everywhere and leaves nothing to tell it by.
    """
    first, second = _common(parallel, crossed, len(exposure))
    photo = crossed[1][second]
    bright = parallel[2][first] * exposure[photo, None]
    dark = crossed[2][second]
    ratio = (bright @ LUMINANCE) / np.maximum(dark @ LUMINANCE, 1e-4)
    matte = usual(ratio)
    filtered = matte < UNFILTERED
    scale = np.full(len(exposure), 1.0 if filtered else matte, np.float32)
    for number in np.unique(photo) if each else ():
        scale[number] = usual(ratio[photo == number])
    mirrored = bright - scale[photo, None] * dark
    mirrored = mirrored / (BOTH_FILTERED * scale[photo, None] if filtered else scale[photo, None])
    darker = float((ratio < DARKER).mean()) if len(ratio) else 1.0
    more = mirrored @ LUMINANCE
    backward = float(np.maximum(-more, 0).sum() / max(np.maximum(more, 0).sum(), 1e-9))
    return Pairs(first, second, mirrored.astype(np.float32), darker, backward)


def usual(ratio: Floats) -> float:
    """The mode of ratios: that of matte parts, since highlights differ from each other. Half-sample
    mode, Robertson and Cryer, JASA 69, 1974.
    """
    left = np.sort(ratio)
    while len(left) > 3:
        half = (len(left) + 1) // 2
        start = int(np.argmin(left[half - 1 :] - left[: len(left) - half + 1]))
        left = left[start : start + half]
    return float(left.mean()) if len(left) else 1.0


def _common(parallel: Shown, crossed: Shown, photos: int) -> tuple[Index, Index]:
    """Rows of both that are of the same point and photo."""
    keys = [shown[0].astype(np.int64) * photos + shown[1] for shown in (parallel, crossed)]
    rows = np.searchsorted(keys[0], keys[1])
    rows = np.minimum(rows, max(len(keys[0]) - 1, 0))
    same = np.flatnonzero(keys[0][rows] == keys[1]) if len(keys[0]) else np.zeros(0, np.intp)
    return rows[same], same
