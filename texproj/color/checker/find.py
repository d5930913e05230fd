"""A 24-patch color chart in a photo: where it is and what its patches measure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats
from texproj.errors import InputError
from texproj.photo import Photo, srgb_from_linear

ROWS, COLUMNS = 4, 6

SIZES_PX = (1600, 3200)
"""Longer sides of the reduced photo in which the chart is looked for, one after the other."""

LEAST_SIDE_PX, MOST_STRETCHED = 100, 8.0
"""Shorter side of a photo, and longer over shorter, beyond which nothing is looked for: the
detector enlarges the shorter side to 1000 pixels, whatever that takes.
"""

INNER = 0.8
"""Part of a patch's middle, along a line, that is measured."""

LEAST_PIXELS = 25
"""Of a patch, for its mean to mean something."""

CLIPPED = 0.985
"""Linear light from which on a channel is taken as clipped: 253 of 255."""

CLIPPED_SHARE = 0.05
"""Of a patch's pixels, at which it is."""

DARKEST_WHITE = 0.03
"""Linear light of the white patch below which the others drown in noise and rounding."""

TRIM = 0.1
"""Share of a patch's brightest and darkest pixels, dust and scratches, that do not count."""


@dataclass(frozen=True, eq=False)
class Patches:
    """What the 24 patches measure, row by row from dark skin to black.

    rgb: (24, 3) linear light of the photo; noise: (24,) standard deviation of a patch's pixels over
    their mean; xy: (24, 2) places on the chart, -1..1, x right, y down; middle: of the chart in the
    photo, 0..1 from its top-left corner.
    """

    rgb: Doubles
    noise: Doubles
    xy: Doubles
    middle: tuple[float, float] = (0.5, 0.5)

    def turned(self) -> Patches:
        """The same with the chart upside down."""
        return replace(self, rgb=self.rgb[::-1].copy(), noise=self.noise[::-1].copy())


def measure_chart(photo: Photo, corners: Doubles) -> Patches:
    """Measure a chart's patches in linear light. corners: as from `find_charts`.

    Raises InputError, one sentence with the remedy, where the chart is cut off by the border, too
    small, over- or under-exposed.
    """
    name = photo.info.name
    _check_inside(corners, photo)
    linear = photo.linear()
    pixels = [_pixels(linear, corner) for corner in corners]
    if min(map(len, pixels)) < LEAST_PIXELS:
        raise InputError(f"{name}: the color chart is too small in the photo; go closer")
    _check_exposure(pixels, name)
    rgb = np.array([_trimmed_mean(values) for values in pixels])
    noise = np.array([values.mean(axis=1).std() / values.mean() for values in pixels])
    column, row = np.meshgrid(np.linspace(-1, 1, COLUMNS), np.linspace(-1, 1, ROWS))
    x, y = corners.mean(axis=(0, 1)) / (photo.width, photo.height)
    xy = np.stack([column.ravel(), row.ravel()], axis=1)
    return Patches(rgb, noise, xy, (float(x), float(y)))


def find_charts(photo: Photo) -> Iterator[Doubles]:
    """What looks like a chart: (24, 4, 2) corners of the patches' middles, pixels of the photo.

    Searched one after the other, at several sizes and exposures: the next where one was not it.
    """
    detector = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(cv2.mcc.MCC24)
    for picture, scale in _pictures(photo):
        if detector.process(picture, 1):
            found = np.array(detector.getBestColorChecker().getColorCharts(), np.float64)
            yield (found.reshape(ROWS * COLUMNS, 4, 2) + 0.5) / scale


def _pictures(photo: Photo) -> Iterator[tuple[NDArray[np.uint8], float]]:
    """Reduced photos, BGR, and their scales: as they are, then each channel stretched."""
    short, long = sorted((photo.width, photo.height))
    if short < LEAST_SIDE_PX or long > MOST_STRETCHED * short:
        return
    for size in SIZES_PX:
        scale = min(1.0, size / max(photo.width, photo.height))
        small = photo.reduced(size).linear()
        bright = np.percentile(small.reshape(-1, 3)[::7], 98, axis=0)
        for white in (np.ones(3), np.maximum(bright, 1e-3) / 0.8):
            encoded = srgb_from_linear(small / white.astype(np.float32))
            yield cv2.cvtColor(np.round(encoded * 255).astype(np.uint8), cv2.COLOR_RGB2BGR), scale
        if scale == 1:
            return


def _check_inside(corners: Doubles, photo: Photo) -> None:
    size = (photo.width, photo.height)
    if (corners < 1).any() or (corners > np.subtract(size, 1)).any():
        raise InputError(
            f"{photo.info.name}: the color chart is cut off by the photo's border; show it whole"
        )


def _pixels(linear: Floats, corners: Doubles) -> Floats:
    """(n, 3) pixels well inside a patch."""
    inner = corners.mean(axis=0) + INNER * (corners - corners.mean(axis=0))
    low = np.floor(inner.min(axis=0)).astype(int)
    high = np.ceil(inner.max(axis=0)).astype(int) + 1
    mask = np.zeros((high - low)[::-1], np.uint8)
    cv2.fillConvexPoly(mask, np.round(inner - 0.5 - low).astype(np.int32), 1)
    return linear[low[1] : high[1], low[0] : high[0]][mask > 0]


def _check_exposure(pixels: list[Floats], name: str) -> None:
    clipped = [np.mean((values > CLIPPED).any(axis=1)) > CLIPPED_SHARE for values in pixels]
    if any(clipped):
        raise InputError(
            f"{name}: {sum(clipped)} patches of the color chart are over-exposed; take it darker"
        )
    if max(values.mean() for values in pixels) < DARKEST_WHITE:
        raise InputError(f"{name}: the color chart is too dark to be measured; take it brighter")


def _trimmed_mean(values: Floats) -> Doubles:
    """(3,) mean of a patch without its brightest and darkest pixels."""
    order = np.argsort(values.sum(axis=1))
    cut = int(len(order) * TRIM)
    return values[order[cut : len(order) - cut]].mean(axis=0, dtype=np.float64)
