"""Do the block's points lie nearer to the scan's surface, or do those of its mirror image?

Both are brought onto the surface, and their distances from it compared cell by cell of space, as
pairs. It tells where a scan is too coarse for the photos' details. Method: ours; the test is
Student's.
"""

from __future__ import annotations

import numpy as np

from texproj.arrays import Bools, Doubles
from texproj.register.block.cloud import Cloud
from texproj.register.block.decide import Judged
from texproj.register.block.surface_fit import Known, faces_cameras, on_surface

POINTS = 20_000
LOOSE = np.diag(np.square([3e-3] * 7 + [1e-3]))
"""Covariance of `PatchFit`'s unknowns within which a place by the structure of a few photos is
right: the surface decides the rest."""
NEAR, MOST = 0.03, 0.008
"""Distance, sizes of the block, up to which a point belongs to the surface, and from which on a
larger one says no more: what the scan lacks."""
CELLS, LEAST_IN_CELL = 8, 5
"""Cells along a block of size 1, and the points from which on one counts."""


def surface_t(cloud: Cloud, own: Judged, other: Cloud, rival: Judged) -> float:
    """Student's t over cells, positive where the block's own points fit better. other: the mirrored
    cloud, its points in the same order; 0 where nothing can be compared.
    """
    (near, off), (near_too, off_too) = _distances(cloud, own), _distances(other, rival)
    both = near & near_too
    cell = np.floor(cloud.xyz[: len(both)][both] * CELLS).astype(np.intp)
    if not len(cell):
        return 0.0
    _, number, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    difference = np.bincount(number.ravel(), (off_too - off)[both]) / count
    used = count >= LEAST_IN_CELL
    return _weighted_student(difference[used], np.sqrt(count[used]))


def _distances(cloud: Cloud, at: Judged) -> tuple[Bools, Doubles]:
    """Of the cloud's points brought onto the surface: (n,) whether they belong to it; (n,) their
    distance from it, at most `MOST`, sizes of the block.
    """
    samples = at.place.proposer.scan.samples
    known = Known(at.placed, LOOSE, at.place.pivot, at.place.unit)
    fitted = on_surface(cloud, samples, known)
    placed = at.placed if fitted is None else fitted[0]
    to_unit = samples.world_from_unit.inverse @ placed.world_from_block
    there = to_unit.apply(cloud.block_from_unit.apply(cloud.xyz[:POINTS].astype(np.float64)))
    distance, nearest = samples.tree.query(there)
    size = at.place.unit / samples.world_from_unit.scale
    near = (distance < NEAR * size) & faces_cameras(cloud, samples, to_unit, nearest)
    gap = np.einsum("ij,ij->i", samples.normal[nearest], there - samples.xyz[nearest])
    return near, np.minimum(np.abs(gap) / size, MOST)


def _weighted_student(values: Doubles, weight: Doubles) -> float:
    """Student's t of the weighted mean of (n,) values; 0 for less than two."""
    if len(values) < 2:
        return 0.0
    mean = float(np.average(values, weights=weight))
    error = float(np.sqrt(np.sum((weight * (values - mean)) ** 2))) / float(weight.sum())
    return mean / max(error, 1e-12)
