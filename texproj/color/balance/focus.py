"""Which parts of which photos are blurred: they show less fine detail than the other photos do at
the same places of the surface.

The idea of a mask for focus is Callieri et al. 2008; the measure is ours. Contrast that a photo
lacks at all wavelengths (haze, flat light) is not blur: what counts is what the fine wavelengths
lack beyond that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.balance.photometry import Photometry, solve_photometry
from texproj.color.balance.shared_points import SharedPoints
from texproj.color.balance.sharpness import Detail, chosen
from texproj.color.weights.picture import FLOOR
from texproj.options import ColorOptions

RESOLVED = 0.7
"""Pixels per point from which on a photo can show the finest band: 2.8 per wavelength."""

FLAT = 1e-4
"""Energy (square of contrast) of the finest band that hardly tells anything: 1 % of contrast."""

ABOVE_NOISE = 4.0
"""A place is judged where the others' detail has so many times the energy of the noise."""

WITNESSES = 2
"""Other photos that must resolve a place before a photo is judged there."""

MOST_HAZE = 1.5
"""Log energy that a photo may lack at all wavelengths for other reasons than blur."""

TOLERANCE = 0.35
"""Log energy by which sharp photos differ: up to 0.25 in real ones."""

SURE = 1.96
"""Deviations of a normal distribution: 97.5 % of equally sharp parts get no mark of blur."""

NODES = 8
"""Nodes of the trust grid along the longer side."""

HARDLY = 0.99
"""Trust from which on nothing is done."""

FAR = 0.01
"""Weight of places far from a node, which decide where there are none near."""


@dataclass(frozen=True, eq=False)
class Focus:
    """How sharp a photo is.

    lack: log energy of fine detail against the other photos, the median of all places, 0 = as
    they, None where too few could be compared; trust: (h, w) float32 factor over the picture, None
    for 1 everywhere.
    """

    lack: float | None = None
    trust: Floats | None = None


def solve_focus(shared: SharedPoints, options: ColorOptions) -> list[Focus]:
    """The sharpness of each photo from what all show."""
    found = [Focus() for _ in shared.shots]
    if shared.detail is None or not options.focus_power:
        return found
    detail, lack = lacking(shared.detail)
    for photo in np.unique(detail.photo):
        shot, mine = shared.shots[photo], detail.photo == photo
        assert shot is not None
        nodes = node_positions(shot.camera.width, shot.camera.height)
        bound = upper_medians(detail.place[mine], lack[mine], nodes).reshape(nodes.shape[:2])
        trust = np.exp(options.focus_power * np.minimum(bound + TOLERANCE, 0))
        blurred = trust.min() < HARDLY
        found[photo] = Focus(
            float(np.median(lack[mine])),
            np.maximum(trust, FLOOR).astype(np.float32) if blurred else None,
        )
    return found


def solve_photos(shared: SharedPoints, options: ColorOptions) -> tuple[Photometry, list[Focus]]:
    """What each photo's light needs, with the trust in its focus, and its focus."""
    light, focus = solve_photometry(shared, options), solve_focus(shared, options)
    both = zip(light.corrections, focus, strict=True)
    trusted = tuple(replace(c, trust=f.trust) if f.trust is not None else c for c, f in both)
    return replace(light, corrections=trusted), focus


def lacking(detail: Detail) -> tuple[Detail, NDArray[np.float64]]:
    """The measurements that can be compared, and (m,) log energy against the other photos' median
    there, at the finest band that enough of them resolve, less what is lacking at the coarsest.
    """
    count = len(detail.photo)
    lack = np.full(count, np.nan)
    for band in (1, 0):
        rows = np.flatnonzero(detail.pixels * 2**band > RESOLVED)
        noise = detail.noise[rows] / 4**band
        fine = np.maximum(detail.energy[rows, band] - noise, 0)
        coarse = np.log(detail.energy[rows, -1] + FLAT)
        point = detail.point[rows]
        others, witnesses = median_of_others(fine, point)
        noisy = np.maximum(noise, median_of_others(noise, point)[0])
        judged = (witnesses >= WITNESSES) & (others > ABOVE_NOISE * noisy) & (others > 2 * FLAT)
        short = np.log(fine + FLAT / 2) - np.log(others + FLAT / 2)
        haze = np.clip(coarse - median_of_others(coarse, point)[0], -MOST_HAZE, MOST_HAZE)
        lack[rows[judged]] = (short - haze)[judged]
    known = np.isfinite(lack)
    return chosen(detail, known), lack[known]


def median_of_others(
    values: NDArray[np.floating], group: NDArray[np.integer]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """(m,) median of the other values of the same group, nan if there are none; (m,) how many."""
    order = np.lexsort((values, group))
    sorted_values, sorted_group = np.append(values[order], np.nan), group[order]
    new = np.append(True, sorted_group[1:] != sorted_group[:-1])[: len(order)]
    start = np.maximum.accumulate(np.where(new, np.arange(len(order)), 0))
    others = np.bincount(np.cumsum(new) - 1)[np.cumsum(new) - 1] - 1
    rank = np.arange(len(order)) - start
    low, high = (others - 1) // 2, others // 2
    picks = [sorted_values[start + k + (k >= rank)] for k in (low, high)]
    median, count = np.empty(len(order)), np.empty(len(order), np.intp)
    median[order] = np.where(others > 0, (picks[0] + picks[1]) / 2, np.nan)
    count[order] = others
    return median, count


def node_positions(width: int, height: int) -> NDArray[np.float64]:
    """(h, w, 2) places 0..1 of the nodes, the centers of equal cells of the picture."""
    longer = max(width, height)
    columns, rows = (max(1, round(NODES * side / longer)) for side in (width, height))
    x, y = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    return np.stack([x, y], axis=-1)


def upper_medians(
    place: Floats, values: NDArray[np.float64], nodes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Upper confidence limit (`SURE`) of the weighted median of the values around each node.

    The limit is the quantile that the true median exceeds with that probability (binomial order
    statistics), with as many values as the weights amount to.
    """
    order = np.argsort(values)
    cell = np.array([nodes.shape[1], nodes.shape[0]])
    apart = (place[order][None] - nodes.reshape(-1, 1, 2)) * cell
    weight = np.exp(-0.5 * np.square(apart).sum(axis=2)) + FAR
    total = weight.sum(axis=1)
    effective = total**2 / np.square(weight).sum(axis=1)
    quantile = np.minimum(0.5 + SURE / 2 / np.sqrt(effective), 1)
    below = np.cumsum(weight, axis=1) < (quantile * total * (1 - 1e-9))[:, None]
    return values[order][np.minimum(below.sum(axis=1), len(values) - 1)]
