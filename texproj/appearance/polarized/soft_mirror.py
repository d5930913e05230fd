"""How much of the light that falls on a surface it mirrors, on the mean over the photos."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texproj.appearance.polarized.differences import Pairs, paired
from texproj.appearance.recovered import Appearance
from texproj.appearance.sightings import Readings, Sightings
from texproj.arrays import Floats
from texproj.color.filling.vertices import fill_vertices
from texproj.mesh import Mesh
from texproj.photo import LUMINANCE

LOOKED_AT = 20_000
"""Vertices by which the two sets of photos are judged to be pairs."""


def pairs_of(parallel: Readings, crossed: Readings, exposure: Floats) -> Pairs:
    """The pairs at some of the vertices."""
    count = len(crossed.points.owners.center)
    chosen = np.arange(0, count, max(1, count // LOOKED_AT))
    bright, dark = parallel.of_vertices(chosen), crossed.of_vertices(chosen)
    return _paired(bright, dark, exposure)


def _paired(bright: Sightings, dark: Sightings, exposure: Floats) -> Pairs:
    first, second = ((seen.point, seen.photo, seen.rgb) for seen in (bright, dark))
    return paired(first, second, exposure, each=False)


def with_mirror(
    mesh: Mesh, appearance: Appearance, parallel: Readings, crossed: Readings, exposure: Floats
) -> Appearance:
    """The appearance, found in the crossed photos, with the part of the light that is mirrored."""
    light = appearance.irradiance
    assert light is not None
    mirrored = np.zeros(len(light), np.float32)
    known = np.zeros(len(light), bool)
    for chunk in range(len(crossed.points.sizes)):
        for piece in crossed.store.pieces(chunk):
            rows, dark = crossed.of_chunk(chunk, piece)
            _, bright = parallel.of_chunk(chunk, piece)
            pairs = _paired(bright, dark, exposure)
            weight = dark.trust[pairs.crossed]
            point = dark.point[pairs.crossed]
            total = np.bincount(point, weight, dark.count)
            sums = np.bincount(point, weight * (pairs.mirrored @ LUMINANCE), dark.count)
            shown = np.maximum(light[rows] @ LUMINANCE, 1e-6)
            mirrored[rows] = sums / np.maximum(total, 1e-9) / shown
            known[rows] = total > 0
    part = fill_vertices(mesh, np.repeat(mirrored.clip(0, 1)[:, None], 3, axis=1), known)[:, 0]
    return replace(appearance, mirrored=part)
