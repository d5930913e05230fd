"""The whole of an occluder cut out of its photo, from the part that other photos contradict.

The contradicted part seeds a graph cut on the photo's own colors (Rother, Kolmogorov, Blake,
"GrabCut", SIGGRAPH 2004), so that the cut ends where the occluder ends and not where the evidence
does: what no other photo sees is freed of it too. The seeds and the proof are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bools, Bytes, Floats

REACH = 0.012
"""Distance over which points speak for the picture around them, part of its longer side."""

MAJORITY = 0.6
"""Part of the points around a place that must contradict for it to be a seed."""

JUDGED = 0.25
"""Density of points, against their mean, from which a place is judged."""

LEAST_POINTS = 30
"""Contradicting points of the smallest occluder: fewer are noise, a highlight, a window or a part
of the scan that is off, which blending copes with."""

DEEPEST = 0.015
"""How thick an occluder is at its thickest, at least, part of the longer side: what is thinner is
an edge that is off."""

SAME_LIGHT = 0.12
"""Median deviation of log light, within which a part differs by its light alone."""

TINT = 0.4
"""Range of log light over the channels between sun and shade: the sky is blue."""

PROOF = 0.75
"""Part of the judged points inside of a cut that must contradict."""

RIM = 0.035
"""How far from the mesh's outline an occluder reaches, at least, part of the longer side: beside
the outline scans end too early or too late, and photos show what is behind."""

GROWTH = 6.0
"""Largest ratio of the cut's area on the mesh to the contradicted area: beyond, it has run out."""

ROUNDS = 3
AROUND = 1.0
"""How far around a contradicted part an occluder is sought, in sizes of that part, and at least
`LEAST_AROUND` of the picture's longer side: time goes with the area."""
LEAST_AROUND = 0.12
MARGIN = 0.008
"""By which a cut is widened, part of the longer side: the soft edge of what is cut out."""


@dataclass(frozen=True, eq=False)
class Told:
    """What other photos say of some points in a picture.

    xy_px: (n, 2) from the top-left corner of the picture; against: (n,) bool, the others contradict
    the picture there, else they confirm it; ratio: (n, 3) log of the picture's light over theirs.
    """

    xy_px: Floats
    against: Bools
    ratio: Floats

    @property
    def enough(self) -> bool:
        """Whether there can be an occluder at all."""
        return int(np.count_nonzero(self.against)) >= LEAST_POINTS

    def pixels(self, shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns in a picture of (h, w); what is just beyond its edge is on it."""
        column, row = np.floor(self.xy_px).astype(np.intp).T
        return row.clip(0, shape[0] - 1), column.clip(0, shape[1] - 1)


@dataclass(frozen=True, eq=False)
class Seeds:
    """(h, w) bool images. core: contradicted parts of the picture, each large enough; safe: parts
    that are confirmed.
    """

    core: Bools
    safe: Bools


def cut_out(picture: Bytes, on_mesh: Bools, told: Told) -> Bools | None:
    """(h, w) bool: what hides the mesh in the (h, w, 3) sRGB picture; None where nothing does.

    on_mesh: (h, w) where the mesh is, behind whatever hides it.
    """
    seeds = seeds_of(on_mesh, told)
    if not seeds.core.any():
        return None
    hidden = np.zeros(on_mesh.shape, bool)
    count, parts = cv2.connectedComponents(seeds.core.astype(np.uint8), connectivity=8)
    for number in range(1, count):
        core = parts == number
        if not hidden[core].all():
            cut = _grown_nearby(picture, told, Seeds(core, seeds.safe))
            hidden |= cut if _proved(cut, on_mesh, told, seeds) else core
    margin_px = round(MARGIN * max(hidden.shape))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin_px + 1,) * 2)
    return cv2.dilate(hidden.astype(np.uint8), kernel) > 0


def seeds_of(on_mesh: Bools, told: Told) -> Seeds:
    """Parts of the picture where most points contradict, and where most confirm."""
    longest = max(on_mesh.shape)
    against, for_ = (_density(on_mesh.shape, told, which, REACH * longest) for which in (1, 0))
    total = against + for_
    mean = float(total[on_mesh].mean()) if on_mesh.any() else 0.0
    judged = on_mesh & (total > JUDGED * max(mean, 1e-9))
    mostly = against > MAJORITY * total
    core, parts = np.zeros(on_mesh.shape, bool), (judged & mostly).astype(np.uint8)
    depth = cv2.distanceTransform(parts, cv2.DIST_L2, 5)
    inwards = cv2.distanceTransform(on_mesh.astype(np.uint8), cv2.DIST_L2, 5)
    count, labels = cv2.connectedComponents(parts, connectivity=8)
    inside = labels[told.pixels(labels.shape)][told.against]
    for number in range(1, count):
        here = labels == number
        if np.count_nonzero(inside == number) < LEAST_POINTS:
            continue
        of_it = told.ratio[told.against][inside == number]
        deep = depth[here].max() >= DEEPEST * longest and inwards[here].max() >= RIM * longest
        if deep and not only_light(of_it):
            core |= here
    return Seeds(core, judged & (against < (1 - MAJORITY) * total))


def only_light(ratio: Floats) -> bool:
    """Whether a part of a picture shows the same surface in another light, a shade or the sun:
    (n, 3) log ratios that are the same all over it and about the same in all channels. Of two
    things without any pattern this cannot be told; then it is taken for light.
    """
    middle = np.median(ratio, axis=0)
    spread = np.median(np.abs(ratio - middle), axis=0).max()
    return bool(spread < SAME_LIGHT and np.ptp(middle) < TINT)


def _density(shape: tuple[int, ...], told: Told, which: int, sigma_px: float) -> Floats:
    """Points per pixel, smoothed by a Gaussian."""
    image = np.zeros(shape, np.float32)
    row, column = told.pixels(shape)
    chosen = told.against == bool(which)
    np.add.at(image, (row[chosen], column[chosen]), 1)
    return cv2.GaussianBlur(image, (0, 0), sigma_px)


def _grown_nearby(picture: Bytes, told: Told, seeds: Seeds) -> Bools:
    """(h, w) the cut around one contradicted part, sought in its neighborhood."""
    out = np.zeros(seeds.core.shape, bool)
    near = _neighborhood(seeds.core)
    rows, columns = near
    size = columns.stop - columns.start, rows.stop - rows.start
    xy = (told.xy_px - (columns.start, rows.start)).astype(np.float32)
    inside = ((xy >= 0) & (xy < size)).all(axis=1)
    nearby = Told(xy[inside], told.against[inside], told.ratio[inside])
    part = np.ascontiguousarray(picture[near])
    out[near] = _grown(part, nearby, Seeds(seeds.core[near], seeds.safe[near]))
    return out


def _neighborhood(core: Bools) -> tuple[slice, slice]:
    """Rows and columns around what is True in (h, w)."""
    found = []
    for axis in (1, 0):
        where, size = np.flatnonzero(core.any(axis=axis)), core.shape[1 - axis]
        first, last = int(where[0]), int(where[-1]) + 1
        margin = round(max(AROUND * (last - first), LEAST_AROUND * max(core.shape)))
        found.append(slice(max(first - margin, 0), min(last + margin, size)))
    return found[0], found[1]


def _grown(picture: Bytes, told: Told, seeds: Seeds) -> Bools:
    """The cut around one contradicted part."""
    labels = np.full(seeds.core.shape, cv2.GC_PR_BGD, np.uint8)
    labels[seeds.safe] = cv2.GC_BGD
    labels[seeds.core] = cv2.GC_PR_FGD
    row, column = told.pixels(labels.shape)
    row, column = row[told.against], column[told.against]
    own = seeds.core[row, column]
    labels[row[own], column[own]] = cv2.GC_FGD
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.setRNGSeed(1)  # the color models start from random means
    cv2.grabCut(picture, labels, None, *models, ROUNDS, cv2.GC_INIT_WITH_MASK)
    grown = ((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)).astype(np.uint8)
    _, parts = cv2.connectedComponents(grown, connectivity=4)
    touching = np.bincount(parts[seeds.core], minlength=1)
    kept: Bools = np.isin(parts, np.flatnonzero(touching[1:] > 0) + 1) & (grown > 0)
    return kept


def _proved(cut: Bools, on_mesh: Bools, told: Told, seeds: Seeds) -> bool:
    """Whether the cut holds what is contradicted and little else. seeds: with all such parts."""
    inside = cut[told.pixels(cut.shape)]
    judged, against = int(inside.sum()), int(told.against[inside].sum())
    grown, core = int((cut & on_mesh).sum()), int((seeds.core & cut).sum())
    return grown <= GROWTH * core and against >= PROOF * judged
