"""The samples of a chunk of the surface, corrected and blended, as many at once as fit memory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texproj.arrays import Floats
from texproj.color.balance.corrections import Grid, corrected
from texproj.color.blending.combine import Blend, blend
from texproj.color.points.source import PointSource
from texproj.color.sampling.store import Spill
from texproj.options import ColorOptions


def blend_chunk(
    spill: Spill,
    points: PointSource,
    number: int,
    gains: Floats,
    grids: Sequence[Grid | None],
    options: ColorOptions,
) -> Blend:
    """One color for each point of a chunk.

    gains: (p, 3), grids: (p,) of all photos in all; the share of the blend is (p,) of them too.
    """
    parts, share = [], np.zeros(len(gains))
    for rows in spill.pieces(number):
        stack = corrected(spill.read(number, rows), points, number, grids, rows)
        parts.append(blend(stack, gains, options))
        share[stack.photos] += parts[-1].share
    return Blend(
        np.concatenate([part.rgb for part in parts]),
        np.concatenate([part.weight for part in parts]),
        np.concatenate([part.photo_count for part in parts]),
        share,
    )
