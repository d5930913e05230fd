"""Where a small rendering as a whole best fits a photo: roll, scale and shift by correlation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from texproj.arrays import Floats, Mask
from texproj.solve.orientation import Field

PEAKS_EACH = 3
"""Placements kept for each roll and scale."""
PEAK_CLEARANCE = 0.03
"""Distance between two of them, as a share of the image's width."""
LEAST_OVERLAP = 0.3
"""Share of the template's energy inside the image below which a placement is marked down."""


@dataclass(frozen=True)
class Placement:
    """The template turned by `roll_rad` (clockwise in the picture) and enlarged by `scale` about
    its pivot, then shifted by `shift_px` (x, y), fits the image with correlation `score`.
    """

    score: float
    roll_rad: float
    scale: float
    shift_px: tuple[float, float]


def placements(
    template: Field,
    valid: Mask,
    image: Field,
    rolls_rad: Sequence[float],
    scales: Sequence[float],
    reach: float = 0.3,
) -> list[Placement]:
    """The best placements of `template` (h, w) in `image` (h, w), best first.

    Every pair of roll and scale is tried, with all shifts up to `reach` of the image's size.
    Normalized by the energy of the image under the template's `valid` pixels and by that of the
    template inside of the image.
    """
    search = _Search.of(image, reach)
    found: list[Placement] = []
    for roll, scale in product(rolls_rad, scales):
        turned, mask = _warped(template, valid, roll, scale)
        for score, shift in search.best(turned, mask):
            found.append(Placement(score, roll, scale, shift))
    return sorted(found, key=lambda p: -p.score)


def pivot_px(valid: Mask) -> NDArray[np.float64]:
    """(2,) the point about which `placements` turns and scales: the middle of the valid pixels."""
    y, x = np.nonzero(valid)
    return np.array([x.mean() + 0.5, y.mean() + 0.5])


def _warped(template: Field, valid: Mask, roll: float, scale: float) -> tuple[Field, Floats]:
    h, w = template.shape
    pivot = pivot_px(valid) - 0.5  # OpenCV counts from pixel centers
    c, s = scale * np.cos(roll), scale * np.sin(roll)
    linear = np.array([[c, -s], [s, c]])
    matrix = np.hstack([linear, (pivot - linear @ pivot)[:, None]])
    parts = np.ascontiguousarray(template).view(np.float32).reshape(h, w, 2)
    warped = np.ascontiguousarray(cv2.warpAffine(parts, matrix, (w, h)))
    # an edge turned by `roll` has a doubled angle larger by 2 roll
    turned = warped.view(np.complex64)[..., 0] * np.complex64(np.exp(2j * roll))
    return turned, cv2.warpAffine(valid.astype(np.float32), matrix, (w, h))


@dataclass(frozen=True, eq=False)
class _Search:
    """The image's transforms, computed once, and the shifts (rows, columns) that count."""

    size: tuple[int, int]
    field: NDArray[np.complexfloating]
    energy: NDArray[np.complexfloating]
    frame: NDArray[np.complexfloating]
    dy: NDArray[np.intp]
    dx: NDArray[np.intp]

    @classmethod
    def of(cls, image: Field, reach: float) -> _Search:
        h, w = image.shape
        size = (
            fft.next_fast_len(int(h * (1 + reach)) + 1),
            fft.next_fast_len(int(w * (1 + reach)) + 1),
        )
        my, mx = int(h * reach), int(w * reach)
        return cls(
            size,
            fft.fft2(image, size),
            fft.rfft2(np.abs(image) ** 2, size),
            fft.rfft2(np.ones(image.shape, np.float32), size),
            np.arange(-my, my + 1),
            np.arange(-mx, mx + 1),
        )

    def best(self, template: Field, mask: Floats) -> list[tuple[float, tuple[float, float]]]:
        score = self._scores(template, mask)
        gap = max(1, round(PEAK_CLEARANCE * template.shape[1]))
        out = []
        for _ in range(PEAKS_EACH):
            y, x = np.unravel_index(int(np.argmax(score)), score.shape)
            out.append((float(score[y, x]), (float(self.dx[x]), float(self.dy[y]))))
            score[max(0, y - gap) : y + gap + 1, max(0, x - gap) : x + gap + 1] = -1
        return out

    def _scores(self, template: Field, mask: Floats) -> Floats:
        strength = np.abs(template) ** 2
        inner = fft.ifft2(self.field * np.conj(fft.fft2(template, self.size))).real
        seen = fft.irfft2(self.energy * np.conj(fft.rfft2(mask, self.size)), self.size)
        own = fft.irfft2(self.frame * np.conj(fft.rfft2(strength, self.size)), self.size)
        shifts = np.ix_(self.dy, self.dx)  # negative shifts wrap around
        least = LEAST_OVERLAP * float(strength.sum()) + 1e-6
        energy = np.maximum(seen[shifts], 1e-6) * np.maximum(own[shifts], least)
        return inner[shifts] / np.sqrt(energy)
