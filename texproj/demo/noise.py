"""Random fields that are functions of position: the same point always gives the same value."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import map_coordinates

from texproj.arrays import Floats

CELLS = 96
"""Side of the periodic cube that holds one field; 3.5 MB as float32."""


@lru_cache(maxsize=16)
def _cube(seed: int, slope: float) -> NDArray[np.float32]:
    """(CELLS,)*3 periodic noise, mean 0, deviation 1, whose amplitude falls as frequency^-slope."""
    rng = np.random.default_rng([seed, 7919])
    white = fft.rfftn(rng.standard_normal((CELLS,) * 3, np.float32))
    full, half = fft.fftfreq(CELLS, 1 / CELLS), fft.rfftfreq(CELLS, 1 / CELLS)
    squared = full[:, None, None] ** 2 + full[None, :, None] ** 2 + half[None, None, :] ** 2
    squared[0, 0, 0] = np.inf
    # Frequencies beyond a quarter of the sampling rate are left out: linear interpolation
    # would turn them into visible cells.
    keep = squared < (CELLS / 4) ** 2
    shape = (keep * squared ** (-slope / 2)).astype(np.float32)
    field = fft.irfftn(white * shape, (CELLS,) * 3)
    cube: NDArray[np.float32] = (field / field.std()).astype(np.float32)
    cube.flags.writeable = False
    return cube


def noise(xyz: Floats, period: float, seed: int, slope: float = 1.8) -> Floats:
    """(n,) smooth noise of mean 0 and deviation 1 at (n, 3) points.

    period: distance after which the field repeats, in the unit of the points; detail goes down
    to about a 24th of it. slope: 1.5 rough, 2.5 smooth.
    """
    return map_coordinates(
        _cube(seed, slope), (np.asarray(xyz, np.float32) * (CELLS / period)).T,
        order=1, mode="grid-wrap", prefilter=False, output=np.float32,
    )  # fmt: skip
