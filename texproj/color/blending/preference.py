"""How strongly the best photo of a point is preferred, decided by the photos: that with which each
photo is predicted best from the others (leave-one-out). Ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.balance.corrections import Grid, corrected
from texproj.color.blending.combine import METHODS, USUAL_PREFERENCE, Views
from texproj.color.points.source import PointSource
from texproj.color.sampling.store import SampleStore, Stack
from texproj.options import ColorOptions

CANDIDATES = (0.1, 0.2, 0.35, 0.5, 0.85)
"""Below, views along the surface count like frontal ones; beyond, a single photo decides."""

PIECES, POINTS = 24, 1024
"""Parts of the surface that are looked at, and points of each: a twentieth of a second a photo."""

LEFT_OUT = 4
"""Photos that are left out of each part, one at a time."""

WITNESSES = 2
"""Others that must show a point: of one alone nothing can be preferred."""

ANOTHER_THING = 0.1
"""Difference in square roots of linear light beyond which a photo shows something else than the
others, and more difference is no more wrong."""

FEWEST = 2_000
"""Observations below which the photos do not decide."""


def decided(
    store: SampleStore,
    points: PointSource,
    gains: Floats,
    grids: Sequence[Grid | None],
    options: ColorOptions,
) -> ColorOptions:
    """The options with a number for `preference`. gains, grids: as for `blend_chunk`."""
    if options.preference != "auto" or options.blend not in ("multi-band", "robust"):
        return options
    rng = np.random.default_rng(1)
    total = np.zeros(len(CANDIDATES) + 1)
    for number in rng.permutation(len(points.sizes))[:PIECES].tolist():
        start = int(rng.integers(0, max(points.sizes[number] - POINTS, 0) + 1))
        rows = slice(start, min(start + POINTS, points.sizes[number]))
        stack = corrected(store.read(number, rows), points, number, grids, rows)
        factor = gains[stack.photos].astype(np.float32)[:, :, None]
        for photo in rng.permutation(len(stack.photos))[:LEFT_OUT].tolist():
            total += _errors(replace(stack, rgb=stack.rgb * factor), photo, options)
    if total[-1] < FEWEST:
        return replace(options, preference=USUAL_PREFERENCE)
    return replace(options, preference=CANDIDATES[int(total[:-1].argmin())])


def _errors(stack: Stack, photo: int, options: ColorOptions) -> NDArray[np.float64]:
    """The summed squares by which each candidate's prediction of the photo is off, then the number
    of points. The stack's colors are brought to the same exposure.
    """
    others = np.arange(len(stack.photos)) != photo
    weight = stack.weight
    told = (weight[photo] > 0) & ((weight[others] > 0).sum(axis=0) >= WITNESSES)
    if not told.any():
        return np.zeros(len(CANDIDATES) + 1)

    def part(values: Floats | None) -> Floats | None:
        return None if values is None else np.ascontiguousarray(values[others][..., told])

    rgb, left = part(stack.rgb), part(weight)
    assert rgb is not None and left is not None
    views = Views(rgb, left, part(stack.around), part(stack.trust))
    shown = np.sqrt(stack.rgb[photo][:, told].T)
    sums = []
    for candidate in CANDIDATES:
        blended = METHODS[options.blend](views, replace(options, preference=candidate))[1]
        off = ((np.sqrt(np.maximum(blended, 0)) - shown) ** 2).mean(axis=1)
        sums.append(float(np.minimum(off, ANOTHER_THING**2).sum()))
    return np.array([*sums, np.count_nonzero(told)])
