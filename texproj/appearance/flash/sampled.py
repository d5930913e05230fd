"""The photos read at points of the surface, and what that says under the flash."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from texproj.appearance.corners import barycentric
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.observations import (
    CLIPPED,
    Flashes,
    LampShadows,
    Observations,
    Shown,
    Surfel,
    observe,
)
from texproj.appearance.transfer import LIFT
from texproj.arrays import Doubles, Floats, Index
from texproj.color.points.source import Chunk, Owners, PointSource, VertexPoints
from texproj.color.points.texels import TexelPoints
from texproj.color.sampling.gather import project_views
from texproj.color.sampling.photo_set import PhotoSet, reasons
from texproj.color.sampling.prepare import image_pyramid
from texproj.color.sampling.sample import sample
from texproj.color.sampling.store import SampleStore
from texproj.color.sampling.view import WHITE, PhotoView
from texproj.color.weights.surface import SurfaceView
from texproj.mesh import Mesh, vertex_normals
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.render import Renderer
from texproj.render.rays import RayCaster
from texproj.resources.scratch import Scratch
from texproj.resources.threads import opencv_in_one_thread

READING = ColorOptions(
    angle_power=0, density_power=0, clipped_weight=1, focus_power=0, blend="robust", align=False
)
"""Samples weighted by nothing but what is in the way: what light counts for is judged here."""


WHITEST = 247
"""Of 255: `CLIPPED` as it is stored."""

SOME = 0.02
"""Part of a sample at white from which on it is cut."""


class FlashPoints(PointSource, Protocol):
    """Points that also say their normals."""

    def surfel(self, number: int) -> Surfel:
        """The points of a chunk with their own normals."""


class FlashVertices(VertexPoints):
    """The vertices of a mesh."""

    def surfel(self, number: int) -> Surfel:
        rows = self.rows(number)
        return Surfel(self.owners.center[rows], self.owners.normal[rows])


@dataclass(frozen=True, eq=False)
class FlashTexels:
    """The texels of an atlas, their normals between those of the corners of their faces."""

    texels: TexelPoints
    mesh: Mesh

    @property
    def owners(self) -> Owners:
        return self.texels.owners

    @property
    def sizes(self) -> list[int]:
        return self.texels.sizes

    def chunk(self, number: int) -> Chunk:
        return self.texels.chunk(number)

    @cached_property
    def _corners(self) -> tuple[Floats, Floats]:
        xyz = (self.mesh.vertices - self.mesh.center).astype(np.float32)
        return xyz, vertex_normals(self.mesh).astype(np.float32)

    def surfel(self, number: int) -> Surfel:
        chunk = self.chunk(number)
        part = self.parts(chunk)
        normal = np.einsum("nk,nkc->nc", part, self._corners[1][self.mesh.faces[chunk.owner]])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.float32(1e-12))
        return Surfel(chunk.xyz, normal.astype(np.float32))

    def parts(self, chunk: Chunk) -> Floats:
        """(n, 3) weights of the corners of their faces."""
        return barycentric(self._corners[0][self.mesh.faces[chunk.owner]], chunk.xyz)


@dataclass(eq=False)
class _Beside:
    """Notes how each photo was turned upright, and samples where it is at white: a pixel beside a
    highlight that was cut shows less than there was, and does not look cut once it is averaged.
    """

    points: FlashPoints
    white: SampleStore
    orientation: dict[int, int] = field(default_factory=dict)

    def add(self, number: int, surface: SurfaceView, view: PhotoView) -> None:
        if view.info is None:
            return
        self.orientation[number] = view.info.orientation
        first = view.levels[0]
        limit = WHITEST if first.dtype == np.uint8 else CLIPPED * WHITE
        cut = (first >= limit).astype(np.uint8) * 255
        if not cut.any():
            return
        there = replace(view, levels=image_pyramid(Photo(view.info, cut)))
        for chunk in range(len(self.points.sizes)):
            samples = sample(self.points.chunk(chunk), surface, there)
            if samples is not None:
                self.white.add(number, chunk, samples)


@dataclass(frozen=True, eq=False)
class FlashSamples:
    """The samples of all photos at points of a mesh, on disk; a photo is read once.

    white: in place of colors, what part of each sample is at white; failed: why photos could not
    be read, by name.
    """

    points: FlashPoints
    store: SampleStore
    white: SampleStore
    flashes: Flashes
    shadows: LampShadows
    failed: dict[str, str]

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        points: FlashPoints,
        photos: PhotoSet,
        renderer: Renderer,
        lamp: Lamp,
        scratch: Scratch,
        progress: Callable[[int], None] = lambda _: None,
    ) -> FlashSamples:
        """Read all photos, one after the other. progress: called with the number that are done."""
        beside = _Beside(points, SampleStore(points.sizes, scratch))
        with opencv_in_one_thread():
            photos = photos.seen_on(mesh, renderer, scratch)
            renderer.rest()
            views = photos.views(READING)
            read = project_views(points, views, beside, READING, scratch, progress)
        turned = [beside.orientation.get(number, 1) for number in range(len(photos))]
        flashes = Flashes.of(photos.cameras, lamp, turned)
        shadows = shadows_of(mesh)
        return cls(points, read.samples, beside.white, flashes, shadows, reasons(read.failed))

    def observations(self, chunk: int, rows: slice, flashes: Flashes, lamp: Lamp) -> Observations:
        """What the photos say of some points of a chunk."""
        surfel = self.points.surfel(chunk)
        part = Surfel(surfel.xyz[rows], surfel.normal[rows])
        return observe(part, self.read(chunk, rows), flashes, lamp, self.shadows)

    def read(self, chunk: int, rows: slice) -> Shown:
        """What the photos show of some points of a chunk."""
        stack = self.store.read(chunk, rows)
        part = self.white.read(chunk, rows)
        cut = np.zeros(stack.rgb.shape, bool)
        cut[np.searchsorted(stack.photos, part.photos)] = part.rgb > SOME
        return Shown(stack.photos, stack.rgb, stack.weight, cut | (stack.rgb >= CLIPPED))


def shadows_of(mesh: Mesh) -> LampShadows:
    """Where the mesh keeps light off itself."""
    xyz = (mesh.vertices - mesh.center).astype(np.float32)
    return LampShadows(RayCaster(xyz, mesh.faces), mesh.center, LIFT * mesh.diagonal)


def subset(samples: FlashSamples, chosen: Index, lamp: Lamp) -> tuple[Surfel, Observations]:
    """Some of the points, by rising number over all chunks, and what the photos say of them."""
    surfels, seen, start = [], [], 0
    for number, size in enumerate(samples.points.sizes):
        rows = chosen[(chosen >= start) & (chosen < start + size)] - start
        start += size
        if not len(rows):
            continue
        surfel = samples.points.surfel(number)
        for piece in samples.store.pieces(number):
            part = rows[(rows >= piece.start) & (rows < piece.stop)] - piece.start
            shown = samples.read(number, piece).of_points(part)
            own = Surfel(surfel.xyz[piece][part], surfel.normal[piece][part])
            surfels.append(own)
            seen.append(observe(own, shown, samples.flashes, lamp, samples.shadows))
    together = Surfel(
        *(np.concatenate([getattr(s, k) for s in surfels]) for k in ("xyz", "normal"))
    )
    return together, Observations.joined(seen)


def spread_vertices(area: Doubles, known: np.ndarray, count: int) -> Index:
    """Numbers of about `count` of the known points, by the area that each stands for."""
    rows = np.flatnonzero(known & (area > 0))
    if len(rows) <= count:
        return rows
    part = area[rows] / area[rows].sum()
    return np.sort(np.random.default_rng(0).choice(rows, count, replace=False, p=part))
