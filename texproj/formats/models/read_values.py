"""Numbers of the vertices of a ply that this package wrote."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texproj.arrays import Floats
from texproj.errors import InputError
from texproj.formats.foreign import Broken, foreign_parser


def read_values(path: Path, names: Sequence[str]) -> dict[str, Floats]:
    """(V,) float32 of each property, 0 to 1. Raises InputError for a damaged file, or one without
    them.
    """
    from plyfile import PlyData  # noqa: PLC0415 - slow to load

    try:
        with foreign_parser():
            rows = PlyData.read(path)["vertex"].data
            values = {name: np.array(rows[name], np.float32) for name in names}
    except Broken as error:
        raise InputError(f"{path}: damaged ({error}); run `texproj appearance` again") from None
    for name, numbers in values.items():
        if not ((numbers >= 0) & (numbers <= 1)).all():
            raise InputError(
                f"{path}: {name} is not between 0 and 1 everywhere; run `texproj appearance` again"
            )
    return values
