"""Several days, each with a light of its own, and one surface."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from texproj.appearance.light_fit import GLOSS
from texproj.appearance.recovered import Appearance, DaysLight, NaturalLight
from texproj.arrays import Bools, Floats
from texproj.color.filling.vertices import fill_vertices
from texproj.mesh import Mesh

SURE = 0.3
"""Confidence from which on a vertex tells how the scales of two days differ."""

FEWEST = 100
"""Such vertices below which two days have no common scale: the less sure one is left out."""

NO_DAY = "the light of no day is to be believed; of the first: {}"


def of_several_days(
    mesh: Mesh, days: Mapping[str, Appearance], blend: Floats, seen: Bools
) -> Appearance:
    """One surface from what each day tells of it.

    days: by name, found in the photos of that day alone; blend: (V, 3) linear light that all photos
    agree on; seen: (V,) where they see anything. Days are brought to the scale and tint of the
    surest one and averaged by confidence; those whose light was refused tell nothing.
    """
    told = {name: day for name, day in days.items() if day.accepted}
    if not told:
        first = next(iter(days.values()))
        shown = np.clip(blend, 0, 1)
        sure = np.where(seen, first.confidence.max(), 0).astype(np.float32)
        return Appearance(
            shown, first.roughness, first.metallic, None, sure, None, False,
            NO_DAY.format(first.reason), False, first.verdict,
        )  # fmt: skip
    best = max(told.values(), key=lambda day: float(day.confidence.sum()))
    total = np.zeros_like(blend)
    weight = np.zeros(len(blend), np.float32)
    lights: dict[str, NaturalLight] = {}
    for name, day in told.items():
        factor = _scale(day, best)
        if factor is None or not isinstance(day.light, NaturalLight):
            continue
        lights[name] = day.light
        total += day.confidence[:, None] * day.base * factor
        weight += day.confidence
    known = weight > 0
    mean = total / np.maximum(weight, 1e-9)[:, None]
    base = fill_vertices(mesh, np.clip(mean, 0, 1).astype(np.float32), known)
    sure = weight / np.float32(len(lights))
    return Appearance(
        base, best.roughness, best.metallic, blend / (base + np.float32(GLOSS)), sure,
        DaysLight(lights), True, "", best.absolute, best.verdict,
    )  # fmt: skip


def _scale(day: Appearance, best: Appearance) -> Floats | None:
    """(3,) what brings a day's colors to those of another; None where they share too little."""
    if day is best:
        return np.ones(3, np.float32)
    both = (day.confidence > SURE) & (best.confidence > SURE)
    if np.count_nonzero(both) < FEWEST:
        return None
    ratio = (best.base[both] + 1e-3) / (day.base[both] + 1e-3)
    return np.asarray(np.median(ratio, axis=0), np.float32)
