"""The surface under a flash beside the camera: its colors, its gloss, its metals."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from texproj.appearance.flash.everywhere import Points, vertices_everywhere
from texproj.appearance.flash.found import completed, find_materials
from texproj.appearance.flash.held_out import FEWEST_PHOTOS, FlashVerdict, held_out, judged
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.observations import Surfel
from texproj.appearance.flash.sampled import (
    FlashSamples,
    FlashVertices,
    spread_vertices,
    subset,
)
from texproj.appearance.recovered import Appearance, FlashLight, untold
from texproj.arrays import Bools, Floats
from texproj.color.filling.vertices import fill_vertices
from texproj.color.sampling.photo_set import PhotoSet
from texproj.mesh import Mesh
from texproj.render import Renderer
from texproj.resources.scratch import Scratch

FITTED = 20_000
"""Points by which the materials are found: they are few, and each point has ten observations."""

FEWEST_POINTS = 300
"""Seen by three photos, below which no materials are told."""

REFUSED = np.float32(0.1)
"""Confidence of colors that are those of the photos."""

FEW = (
    f"too few photos show the same places under the flash ({FEWEST_PHOTOS} photos and three views"
    " of each place are asked for): take more, a good deal overlapping"
)

Progress = Callable[[str, int, int], None]
"""``progress(what, done, total)``."""


@dataclass(frozen=True, eq=False)
class Blend:
    """What the photos agree on at the vertices: rgb (V, 3) linear light, also where they see
    nothing; seen (V,) where they do.
    """

    rgb: Floats
    seen: Bools


def flash_appearance(
    mesh: Mesh, photos: PhotoSet, renderer: Renderer, lamp: Lamp, blend: Blend, progress: Progress
) -> Appearance:
    """The surface itself, from photos in a dark room lit by a flash that moves with the camera.

    Where the flash does not explain photos that were held out the base color is `blend`'s, so that
    it is never worse. progress: called with what is done, how much, and of how much.
    """
    with closing(Scratch()) as scratch:
        points = FlashVertices.of(mesh)
        samples = FlashSamples.of(
            mesh, points, photos, renderer, lamp, scratch,
            lambda done: progress("flash", done, len(photos)),
        )  # fmt: skip
        area = np.square(points.owners.spacing.astype(np.float64))
        chosen = spread_vertices(area, blend.seen, FITTED)
        if len(photos) < FEWEST_PHOTOS or not len(chosen):
            return _refused(blend, FEW)
        surfels, seen = subset(samples, chosen, lamp)
        lit = np.flatnonzero(seen.number > 0)
        surfels, seen = Surfel(surfels.xyz[lit], surfels.normal[lit]), seen.of_points(lit)
        if np.count_nonzero(seen.number >= 3) < FEWEST_POINTS:
            return _refused(blend, FEW)
        held = held_out(len(photos))
        train = seen.kept(~np.isin(seen.photo, held))
        found = find_materials(
            surfels, train, samples.flashes, lamp, samples.shadows, mesh.diagonal
        )
        found = completed(found, seen)
        verdict = judged(found, held)
        if not verdict.accepted:
            return _refused(blend, verdict.refusal, verdict)
        count = len(mesh.vertices)
        all_points = vertices_everywhere(
            mesh, samples, found, lambda done: progress("materials", done, count)
        )
        return _appearance(
            mesh, all_points, FlashLight(found, photos.names, all_points.label), verdict
        )


def _appearance(mesh: Mesh, points: Points, light: FlashLight, verdict: FlashVerdict) -> Appearance:
    found = light.found
    roughness = np.array([one.roughness for one in found.materials], np.float32)[points.label]
    metallic = np.array([kind.metal for kind in found.kinds], np.float32)[points.label]
    base = fill_vertices(mesh, points.color, points.seen)
    return Appearance(
        base, roughness, metallic, None, points.sure, light, True, "",
        not found.assumed, verdict,
    )  # fmt: skip


def _refused(blend: Blend, reason: str, verdict: FlashVerdict | None = None) -> Appearance:
    little = np.where(blend.seen, REFUSED, np.float32(0))
    base = np.clip(blend.rgb, 0, 1)
    return Appearance(
        base, *untold(len(base)), None, little, None, False, reason, False, verdict
    )  # fmt: skip
