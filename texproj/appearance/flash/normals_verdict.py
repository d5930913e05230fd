"""Whether normals that the photos tell are to be believed: photos that were held out are predicted
with them, and with those of the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from texproj.appearance.flash.closed_form import labelled_terms, predicted
from texproj.appearance.flash.everywhere import texels_by_material, tilted_points
from texproj.appearance.flash.found import Found
from texproj.appearance.flash.held_out import FEWEST, held_out, psnr_at_best_output
from texproj.appearance.flash.sampled import FlashSamples, subset
from texproj.appearance.flash.tilt import Turning
from texproj.arrays import Bools, Index

JUDGED = 20_000
"""Texels by which it is judged."""

LEAST_GAIN_DB = 0.1
"""By which photos have to be predicted better: where the mesh is right they are .1 to .3 worse."""


@dataclass(frozen=True)
class NormalsVerdict:
    """mesh_db, own_db: how well photos that were held out are predicted with the normals of the
    mesh, and with those that the other photos tell; PSNR as shown, dB; share: of the surface whose
    normals differ.
    """

    accepted: bool
    mesh_db: float
    own_db: float
    share: float

    @property
    def reason(self) -> str:
        """Why they are refused, in one sentence; empty where they are not."""
        if self.accepted:
            return ""
        return (
            "the photos tell no normals finer than the mesh's: those held out are predicted by"
            f" {self.own_db:.1f} dB with normals of their own, by {self.mesh_db:.1f} with those of"
            " the mesh"
        )


def judged_normals(
    samples: FlashSamples, found: Found, allowed: Callable[[int], Bools]
) -> NormalsVerdict:
    """The verdict on texels whose photos were read. allowed: of a chunk, (n, k) the materials that
    its texels may be of.
    """
    chosen = _spread(samples.points.sizes)
    if not len(chosen):
        return NormalsVerdict(False, 0.0, 0.0, 0.0)
    surfels, seen = subset(replace(samples, flashes=found.flashes), chosen, found.lamp)
    seen = replace(seen, around=found.field.at(surfels, seen.point, seen.photo))
    ends = np.cumsum([0, *samples.points.sizes])
    rows = [chosen[(chosen >= a) & (chosen < b)] - a for a, b in pairwise(ends)]
    may_be = np.concatenate([allowed(k)[part] for k, part in enumerate(rows) if len(part)])
    photos = len(found.flashes.cameras)
    out = np.isin(seen.photo, held_out(photos))
    train, test = seen.kept(~out), seen.kept(out & (seen.number >= 4)[seen.point])
    plain = texels_by_material(surfels, train, found, may_be)
    own = tilted_points(surfels, train, plain, found)
    turning = Turning.of(surfels, test, found.flashes, found.shadows.center)
    told = []
    for points in (plain, own):
        turned = turning.facing(points.normal)
        terms = labelled_terms(turned, found.kinds, points.label)
        told.append(psnr_at_best_output(test, predicted(*terms, test, points.color), photos))
    mesh_db, own_db = told
    share = float((own.normal != surfels.normal).any(axis=1).mean())
    good = len(test.point) >= FEWEST and own_db - mesh_db >= LEAST_GAIN_DB
    return NormalsVerdict(bool(good), mesh_db, own_db, share)


def _spread(sizes: Sequence[int]) -> Index:
    """Numbers of `JUDGED` texels, rising."""
    count = sum(sizes)
    if count <= JUDGED:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, JUDGED, replace=False))
