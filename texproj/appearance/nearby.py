"""The light of the day told once more by points that are near each other: paint varies less from
place to place there than over the whole surface.

Ours. Points of one paint in one cell of the surface have an albedo of their own, at random around
the palette's, as a point of a turned object has one in all its photos: the same random-effects
model (`turntable.room_fit`). What differs across the edge of a shadow counts by itself, and paint
that is darker on one side of the piece is taken for light no more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texproj.appearance.light_fit import LightFit, LitPoints, spread
from texproj.appearance.palette import log_chroma, medians, members, moved
from texproj.appearance.sightings import Sightings
from texproj.appearance.turntable.room_fit import gauged, stepped
from texproj.arrays import Index

ROUNDS = 8
MOVES = 2
"""Rounds of k-means in each round: clusters follow the light."""


def told_nearby(points: LitPoints, fit: LightFit, cell: Index) -> LightFit:
    """A light after steps of Gauss and Newton. cell: (n,) number of each point's small cell."""
    columns = points.columns
    for _ in range(ROUNDS):
        irradiance = fit.irradiance(points)
        albedo = gauged(np.pi * points.rgb / irradiance, irradiance)
        chroma = log_chroma(albedo)
        centers = moved(chroma, fit.centers, MOVES)
        label = members(chroma, centers)
        palette = medians(albedo, label, len(centers))
        number = cell * len(centers) + label
        order = np.argsort(number, kind="stable")
        groups, point = np.unique(number[order], return_inverse=True)
        ones = np.ones(len(order), np.float32)
        shown = points.rgb[order].astype(np.float32)
        seen = Sightings(len(groups), point, np.zeros_like(point), shown, ones)
        light = fit.sky if fit.sun is None else np.vstack([fit.sky, fit.sun])
        paint = palette[groups % len(centers)]
        light, _ = stepped(seen, columns[order], light, irradiance[order], paint)
        sun = None if fit.sun is None else light[9]
        fit = replace(fit, sky=light[:9], sun=sun, centers=centers, albedo=palette)
    return replace(fit, spread=spread(points, fit.predicted(points)))
