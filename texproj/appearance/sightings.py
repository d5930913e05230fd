"""What each photo shows of points of the surface, one row a sighting."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texproj.appearance.by_point import ByPoint
from texproj.appearance.flash.observations import Surfel, dots, unit
from texproj.arrays import Bools, Doubles, Floats, Index
from texproj.color.points.source import VertexPoints
from texproj.color.sampling.gather import project_views
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.sampling.store import SampleStore, Stack
from texproj.color.sampling.view import PhotoView
from texproj.color.weights.surface import SurfaceView
from texproj.mesh import Mesh
from texproj.options import ColorOptions
from texproj.render import Renderer
from texproj.resources.scratch import Scratch
from texproj.resources.threads import opencv_in_one_thread

READING = ColorOptions(
    angle_power=0, density_power=0, clipped_weight=1, focus_power=0, blend="robust", align=False
)
"""Samples weighted by nothing but what is in the way: what they count for is judged here."""

LEAST_NV = 0.2
"""Cosine to the eye below which a sighting is one of an edge."""

LEAST_TRUST = 0.05
DARK, CLIPPED = 2e-3, 0.93
"""Linear light between which a color is known."""


@dataclass(frozen=True, eq=False)
class Sightings(ByPoint):
    """m sightings of `count` points, ordered by point.

    point, photo: (m,) numbers; rgb: (m, 3) linear light; trust: (m,) cosine to the eye times what
    the picture is worth there.
    """

    photo: Index
    rgb: Floats
    trust: Floats

    def kept(self, rows: Bools) -> Sightings:
        """Some of them, of all points."""
        return Sightings(
            self.count, self.point[rows], self.photo[rows], self.rgb[rows], self.trust[rows]
        )

    def scaled(self, gain: Floats) -> Sightings:
        """As if each photo (p,) had been exposed by so much less."""
        return replace(self, rgb=self.rgb / gain[self.photo, None])


class _Nobody:
    """Looks at no view."""

    def add(self, number: int, surface: SurfaceView, view: PhotoView) -> None:
        del number, surface, view


@dataclass(frozen=True, eq=False)
class Readings:
    """The samples of all photos at the vertices of a mesh, on disk; a photo is read once."""

    points: VertexPoints
    store: SampleStore
    eye: Floats

    @classmethod
    def of(
        cls, mesh: Mesh, photos: PhotoSet, renderer: Renderer, scratch: Scratch,
        progress: Callable[[int], None] = lambda _: None,
    ) -> Readings:  # fmt: skip
        """Read all photos, one after the other. progress: called with the number that are done."""
        points = VertexPoints.of(mesh)
        with opencv_in_one_thread():
            photos = photos.seen_on(mesh, renderer, scratch)
            renderer.rest()
            views = photos.views(READING)
            read = project_views(points, views, _Nobody(), READING, scratch, progress)
        eye = np.stack([camera.center - mesh.center for camera in photos.cameras])
        return cls(points, read.samples, eye.astype(np.float32))

    def surfel(self, rows: Any) -> Surfel:
        """The vertices of numbers or of a slice."""
        owners = self.points.owners
        return Surfel(owners.center[rows], owners.normal[rows])

    def of_chunk(self, chunk: int, piece: slice) -> tuple[slice, Sightings]:
        """Some points of a chunk: which vertices they are, and what photos show of them."""
        start = self.points.rows(chunk).start
        rows = slice(start + piece.start, start + piece.stop)
        return rows, self._seen(self.surfel(rows), self.store.read(chunk, piece))

    def of_vertices(self, chosen: Index) -> Sightings:
        """What photos show of vertices of rising numbers."""
        parts, before = [], 0
        for chunk in range(len(self.points.sizes)):
            start = self.points.rows(chunk).start
            for piece in self.store.pieces(chunk):
                low, high = start + piece.start, start + piece.stop
                rows = chosen[(chosen >= low) & (chosen < high)]
                if not len(rows):
                    continue
                stack, part = self.store.read(chunk, piece), rows - low
                stack = Stack(stack.photos, stack.rgb[:, :, part], stack.weight[:, part])
                seen = self._seen(self.surfel(rows), stack)
                parts.append(replace(seen, point=seen.point + before))
                before += len(rows)
        return Sightings(
            len(chosen),
            *(np.concatenate([getattr(p, k) for p in parts]) for k in ("point", "photo")),
            *(np.concatenate([getattr(p, k) for p in parts]) for k in ("rgb", "trust")),
        )

    def _seen(self, surfels: Surfel, stack: Stack) -> Sightings:
        point, row = np.nonzero((stack.weight > LEAST_TRUST).T)
        photo, rgb = stack.photos[row], stack.rgb[row, :, point]
        to_eye, _ = unit(self.eye[photo] - surfels.xyz[point])
        nv = dots(surfels.normal[point], to_eye)
        known = (nv > LEAST_NV) & (rgb.max(axis=1) < CLIPPED) & (rgb.max(axis=1) > DARK)
        trust = stack.weight[row, point] * nv
        count = len(surfels.xyz)
        return Sightings(count, point[known], photo[known], rgb[known], trust[known])


def point_means(seen: Sightings, values: Doubles, weight: Doubles) -> Doubles:
    """(count, k) weighted means of (m, k) values over each point's sightings, 0 without any."""
    total = seen.sums(weight[:, None])
    return np.asarray(seen.sums(values * weight[:, None]) / np.maximum(total, 1e-20))
