"""Patch matching between two orientation fields by normalized correlation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from texproj.arrays import Bools, Doubles, Index
from texproj.solve.orientation import Field

BATCH_BYTES = 1 << 19
"""Spectra worked on at once, so that they stay in the processor's cache: alone that saves a third
of the time of patches of 41 pixels against 64 at once, within a registration a tenth."""


@dataclass(frozen=True, eq=False)
class PatchMatches:
    """Where patches of a template were found in an image.

    patch: (n,) number of the patch, several matches may share one; source_px: (n, 2) centers in
    the template; target_px: (n, 2) where found in the image; both continuous coordinates.
    score: (n,) normalized correlation in -1..1; rank: (n,) 0 for a patch's best match.
    strength: (patches,) mean squared length of the template's field in each patch sought, 0..1.
    """

    patch: Index
    source_px: Doubles
    target_px: Doubles
    score: Doubles
    rank: Index
    strength: Doubles

    def __len__(self) -> int:
        return len(self.patch)


@dataclass(frozen=True, eq=False)
class SearchImage:
    """An orientation field in which `size` square patches are sought within +-`radius` pixels.

    padded: with a border of zeros as wide as a search reaches; energy: of the patch around each of
    its pixels.
    """

    padded: Field
    energy: NDArray[np.float32]
    size: int
    radius: int

    @classmethod
    def of(cls, image: Field, size: int, radius: int) -> SearchImage:
        padded = np.pad(image, size // 2 + radius)
        energy = cv2.boxFilter(
            _squared(padded), -1, (size, size), normalize=False, borderType=cv2.BORDER_CONSTANT
        )
        return cls(padded, np.maximum(energy, 0, out=energy), size, radius)  # sums were rounded

    @property
    def spectrum_px(self) -> int:
        """Rows and columns of the spectra."""
        return int(fft.next_fast_len(self.size + 2 * self.radius))

    @property
    def batch(self) -> int:
        """How many patches are best sought at once."""
        return max(1, BATCH_BYTES // (8 * self.spectrum_px**2))

    def around(self, centers: Index) -> SearchWindows:
        """What a search around (n, 2) pixels x, y looks at."""
        half, n = self.size // 2, self.spectrum_px
        spectrum = np.empty((len(centers), n, n), np.complex64)
        for k in range(0, len(centers), self.batch):
            part = slice(k, k + self.batch)
            windows = _windows(self.padded, centers[part], self.size + 2 * self.radius)
            spectrum[part] = _transformed(windows, n)
        # energy of the image patch shifted by d sits at the center of that patch
        energy = _windows(self.energy[half:, half:], centers, 2 * self.radius + 1)
        return SearchWindows(centers, spectrum, energy, self.size, self.radius, self.batch)


@dataclass(frozen=True, eq=False)
class SearchWindows:
    """Windows of an image in which `size` square patches are sought within +-`radius` pixels.

    center: (n, 2) x, y of their middles; spectrum: (n, m, m) complex64; energy: (n, span, span)
    float32 of the patch at each shift; batch: how many are best sought at once.
    """

    center: Index
    spectrum: Field
    energy: NDArray[np.float32]
    size: int
    radius: int
    batch: int

    def at(self, which: Index) -> SearchWindows:
        """Some of them."""
        center, spectrum, energy = self.center[which], self.spectrum[which], self.energy[which]
        return SearchWindows(center, spectrum, energy, self.size, self.radius, self.batch)


def patch_grid(valid: NDArray[np.bool_], size: int, step: int, filled: float = 0.7) -> Index:
    """(n, 2) x, y of the pixels on a regular grid around which a `size` square is `filled`.

    The pixel itself must be valid too: it is what the match is about.
    """
    share = cv2.blur(valid.astype(np.float32), (size, size), borderType=cv2.BORDER_CONSTANT)
    h, w = valid.shape
    x, y = np.meshgrid(_axis(w, step), _axis(h, step))
    keep = (share[y, x] >= filled) & valid[y, x]
    return np.stack([x[keep], y[keep]], axis=1)


def match_patches(
    template: Field, image: Field, centers: Index, size: int, radius: int, peaks: int = 1
) -> PatchMatches:
    """Find `size` square patches of `template` around `centers` (n, 2) within +-`radius` pixels
    of the same place in `image`.

    Correlation maxima on the rim of the search window are not maxima and are dropped, so a
    patch may yield no match; at most `peaks` each. Sub-pixel by a parabola along each axis.
    """
    big_t, searched = np.pad(template, size // 2), SearchImage.of(image, size, radius)
    parts = []
    for k in range(0, len(centers), searched.batch):
        some = centers[k : k + searched.batch]
        windows = _windows(big_t, some, size)
        parts.append(_match_batch(windows, searched.around(some), peaks, k))
    return _joined(parts)


def match_windows(
    windows: Callable[[Index], Field], searched: SearchWindows, which: Index
) -> PatchMatches:
    """Find patches in the windows `which` (n,) of an image; as `match_patches`, of patches that
    need not come from one template. windows: gives (k, size, size) some of them; it is asked for as
    many at once as stay in the processor's cache.
    """
    parts = []
    for k in range(0, len(which), searched.batch):
        some = which[k : k + searched.batch]
        parts.append(_match_batch(windows(some), searched.at(some), 1, k))
    return _joined(parts)


def _match_batch(t: Field, searched: SearchWindows, peaks: int, first: int) -> PatchMatches:
    size, span = searched.size, 2 * searched.radius + 1
    t = np.ascontiguousarray(t)
    spectrum = _transformed(t, searched.spectrum.shape[1])
    np.conj(spectrum, out=spectrum)
    spectrum *= searched.spectrum
    rows = fft.ifft(spectrum, axis=1, overwrite_x=True)[:, :span]  # the others are not looked at
    correlation = fft.ifft(rows, axis=2)[:, :, :span].real
    own = _squared(t).sum((1, 2)).astype(np.float64)
    score = correlation / np.sqrt(own[:, None, None] * searched.energy + 1e-6)
    patch, shift, value, rank = _peaks(score, searched.radius, peaks)
    source = searched.center[patch].astype(np.float64) + 0.5
    return PatchMatches(patch + first, source, source + shift, value, rank, own / size**2)


def _transformed(windows: Field, n: int) -> Field:
    """(k, n, n) spectra of (k, m, m) windows, zeros around them: rows of zeros are not transformed
    along themselves.
    """
    out: Field = fft.fft(fft.fft(windows, n, axis=2), n, axis=1, overwrite_x=True)
    return out


def _squared(field: Field) -> NDArray[np.float32]:
    """(...) float32 squared length, many times as fast as by the root that is squared again."""
    out: NDArray[np.float32] = np.square(field.real) + np.square(field.imag)
    return out


def _windows(image: NDArray[Any], corners: Index, size: int) -> NDArray[Any]:
    view = np.lib.stride_tricks.sliding_window_view(image, (size, size))
    return view[corners[:, 1], corners[:, 0]]


def _peaks(
    score: NDArray[np.float32], radius: int, peaks: int
) -> tuple[Index, Doubles, Doubles, Index]:
    """Local maxima of (n, s, s) maps, at most `peaks` per map: patch, (m, 2) shift, score, rank.

    A map that is highest on its rim gives none.
    """
    span = 2 * radius + 1
    top_y, top_x = np.divmod(score.reshape(len(score), -1).argmax(axis=1), span)
    inside = (np.minimum(top_x, top_y) > 0) & (np.maximum(top_x, top_y) < span - 1)
    best = _best(score, top_x, top_y, inside) if peaks == 1 else _several(score, inside, peaks)
    patch, y, x, ranks = best
    middle = score[patch, y, x]
    dx = x - radius + _parabola(score[patch, y, x - 1], middle, score[patch, y, x + 1])
    dy = y - radius + _parabola(score[patch, y - 1, x], middle, score[patch, y + 1, x])
    return patch, np.stack([dx, dy], axis=1), middle.astype(np.float64), ranks


def _best(score: NDArray[np.float32], x: Index, y: Index, inside: Bools) -> Index:
    """(4, m) patch, row, column, rank 0 where the highest place x, y (n,) is a peak."""
    found = np.flatnonzero(inside)
    found = found[score[found, y[found], x[found]] > 0]
    return np.stack([found, y[found], x[found], np.zeros_like(found)])


def _several(score: NDArray[np.float32], inside: Bools, peaks: int) -> Index:
    """(4, m) patch, row, column, rank of the highest peaks."""
    rows, width = np.arange(len(score)), score.shape[2] - 2
    value = np.where(_is_peak(score), score[:, 1:-1, 1:-1], -np.inf).reshape(len(score), -1)
    out = []
    for rank in range(peaks):
        best = value.argmax(axis=1)
        found = rows[inside & (value[rows, best] > 0)]
        y, x = np.divmod(best[found], width)
        out.append(np.stack([found, y + 1, x + 1, np.full_like(found, rank)]))
        value[rows, best] = -np.inf
    return np.concatenate(out, axis=1)


def _is_peak(score: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(n, s - 2, s - 2) of (n, s, s): no neighbor is higher."""
    n = score.shape[1]
    core = score[:, 1:-1, 1:-1]
    peak = np.ones(core.shape, np.bool_)
    for y, x in product(range(3), range(3)):
        peak &= core >= score[:, y : n - 2 + y, x : n - 2 + x]
    return peak


def _parabola(left: NDArray[Any], middle: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """Offset in -0.5..0.5 of the maximum of the parabola through three equidistant values."""
    curve = left - 2 * middle + right
    return np.where(
        curve < 0, np.clip(0.5 * (left - right) / np.minimum(curve, -1e-12), -0.5, 0.5), 0
    )


def _axis(length: int, step: int) -> Index:
    """Grid positions with equal margins on both sides."""
    return np.arange((length - 1) % step // 2, length, step)


def _joined(parts: list[PatchMatches]) -> PatchMatches:
    if not parts:
        none = np.zeros(0, np.intp)
        return PatchMatches(
            none, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), none, np.zeros(0)
        )
    return PatchMatches(
        np.concatenate([p.patch for p in parts]),
        np.concatenate([p.source_px for p in parts]),
        np.concatenate([p.target_px for p in parts]),
        np.concatenate([p.score for p in parts]),
        np.concatenate([p.rank for p in parts]),
        np.concatenate([p.strength for p in parts]),
    )
