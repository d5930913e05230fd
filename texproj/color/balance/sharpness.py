"""How much fine detail each photo shows at the same places of the surface.

Patches of the surface are looked up in every photo, so that all photos measure the same content at
the same physical frequencies, foreshortened or not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.points.source import Chunk, Owners, PointSource, spread_points
from texproj.color.sampling.pixel_lookup import depth_pixels, photo_pixels, read_colors
from texproj.color.sampling.sample import project
from texproj.color.sampling.view import WHITE, PhotoView
from texproj.color.weights.surface import SurfaceView, facing, resolution

CANDIDATES = 8000
"""Places that a photo may be measured at, in an order that is the same for all photos."""

MEASURED = 400
"""Places at which a photo is measured: the first of those that it sees."""

BLOCK = 32
"""Patches that are looked up at once."""

GRAY = np.array([[0.25, 0.5, 0.25]], np.float32)

SIDE = 32
"""Points along the edge of a patch, as far apart as the points to be colored."""

BANDS = 3
"""Wavelengths of 4, 8 and 16 points."""

UNDOUBTED = 0.3
"""Least product of the picture's factors: patches do not lie across its border or a silhouette."""

DARKEST, BRIGHTEST = 0.01, 0.8
"""Linear light of patches that are neither noise nor clipped."""

QUIET_BLOCKS = 4
"""Blocks along a patch's edge, the quietest of which tells of the photo's noise."""

QUIETEST = 0.02
"""Of all patches, the part whose quietest block is taken for nothing but noise."""

QUIET_NOISE = 0.307
"""Energy of white noise in such a block, second differences over 8, against its variance: by
simulation."""


@dataclass(frozen=True, eq=False)
class Detail:
    """m measurements.

    photo, point: (m,) int32 of what and where; place: (m, 2) float32 where in the picture, 0..1
    across and down; energy: (m, BANDS) float32 of second differences in the patch, divided by its
    mean brightness: finest first; noise: (m,) float32 what of the finest is noise, a quarter of it
    is in the next; pixels: (m,) float32 pixels of the photo per point along the shorter axis.
    """

    photo: NDArray[np.int32]
    point: NDArray[np.int32]
    place: Floats
    energy: Floats
    noise: Floats
    pixels: Floats


class DetailMeter:
    """Measures one photo after the other; some 15 kB are kept of each."""

    def __init__(self, points: PointSource) -> None:
        chunk = spread_points(points, CANDIDATES)
        chunk = chunk.take(np.random.default_rng(len(chunk)).permutation(len(chunk)))
        owners = points.owners
        normal, spacing = owners.normal[chunk.owner], owners.spacing[chunk.owner]
        self._chunk = chunk
        self._places = Owners(owners.origin, chunk.xyz, normal, spacing)
        self._parts: list[Detail] = []

    def note(self, number: int, measured: Detail) -> None:
        """Keep what was measured of the photo of that number."""
        photo = np.full(len(measured.photo), number, np.int32)
        self._parts.append(replace(measured, photo=photo))

    def look(self, surface: SurfaceView, view: PhotoView) -> Detail | None:
        """Measure a photo, called 0; None if it sees no place."""
        xy_px, seen = self._seen(surface, view)
        if len(seen) == 0:
            return None
        blocks = np.array_split(seen, -(-len(seen) // BLOCK))
        measured = (self._measured(block, surface, view) for block in blocks)
        mean, energy, quiet = map(np.concatenate, zip(*measured, strict=True))
        level = np.quantile(quiet * mean, QUIETEST) * (0.75 / QUIET_NOISE)
        sound = (mean > DARKEST) & (mean < BRIGHTEST)
        place = (xy_px + 0.5) / (view.camera.width, view.camera.height)
        part = Detail(
            np.zeros(len(seen), np.int32), seen.astype(np.int32), place.astype(np.float32),
            energy, (level / np.maximum(mean, DARKEST)).astype(np.float32),
            across(self._places, view.camera)[seen],
        )  # fmt: skip
        return chosen(part, sound)

    def detail(self) -> Detail:
        """All measurements."""
        empty = np.zeros(0, np.float32)
        none = np.zeros(0, np.int32)
        nothing = Detail(none, none, empty.reshape(0, 2), empty.reshape(0, BANDS), empty, empty)
        parts = zip(*map(columns, [nothing, *self._parts]), strict=True)
        return Detail(*map(np.concatenate, parts))

    def _seen(self, surface: SurfaceView, view: PhotoView) -> tuple[Floats, NDArray[np.intp]]:
        """(k, 2) positions in the photo and the numbers of the places to be measured."""
        facing_it = np.flatnonzero(surface.weight[self._chunk.owner] > 0)
        if len(facing_it) == 0:
            return np.zeros((0, 2), np.float32), facing_it
        weight = np.ones(len(facing_it), np.float32)
        xy_px = project(self._chunk.take(facing_it), weight, surface, view).reshape(-1, 2)
        kept = np.flatnonzero(weight > UNDOUBTED)[:MEASURED]
        return xy_px[kept], facing_it[kept]

    def _measured(
        self, seen: NDArray[np.intp], surface: SurfaceView, view: PhotoView
    ) -> tuple[Floats, Floats, Floats]:
        """(k,) mean light of patches and what `energies` says of them."""
        light = self._patches(seen, surface, view)
        mean = light.mean(axis=(1, 2))
        return mean, *energies(light / np.maximum(mean, DARKEST)[:, None, None])

    def _patches(self, seen: NDArray[np.intp], surface: SurfaceView, view: PhotoView) -> Floats:
        """(k, SIDE, SIDE) linear light of the patches."""
        places, owner = self._places, self._chunk.owner[seen]
        right, down = tangents(places.normal[seen])
        step: Floats = (np.arange(SIDE, dtype=np.float32) - np.float32(SIDE / 2 - 0.5))[:, None]
        spacing = places.spacing[seen, None, None]
        rows: Floats = places.center[seen, None] + spacing * step * down[:, None]
        xyz = rows[:, :, None] + (spacing * step * right[:, None])[:, None]
        many = Chunk(xyz.reshape(-1, 3), np.repeat(owner, SIDE * SIDE))
        xy_px = photo_pixels(depth_pixels(many.xyz, surface.origin, view.depth_camera)[0], view)
        level = None if surface.level is None else surface.level[many.owner]
        gray = cv2.transform(read_colors(view, xy_px, level), GRAY).reshape(-1)[: len(many)]
        return (gray * np.float32(1 / WHITE)).reshape(-1, SIDE, SIDE)


def energies(patch: Floats) -> tuple[Floats, Floats]:
    """(n, BANDS) mean squares of second differences, both directions, from points 2, 4 and 8
    apart, over 16; (n,) energy in the quietest block of the finest band, over 8.

    patch: (n, SIDE, SIDE) around 1. Second differences take no notice of even shading.
    """
    out = np.empty((len(patch), BANDS), np.float32)
    quiet = np.zeros(len(patch), np.float32)
    for band in range(BANDS):
        across_ = patch[:, :, 4:] - 2 * patch[:, :, 2:-2] + patch[:, :, :-4]
        down = patch[:, 4:] - 2 * patch[:, 2:-2] + patch[:, :-4]
        out[:, band] = (np.square(across_).mean((1, 2)) + np.square(down).mean((1, 2))) / 16
        if band == 0:
            size = (SIDE - 4) // QUIET_BLOCKS
            inner = across_[:, : SIDE - 4].reshape(-1, QUIET_BLOCKS, size, QUIET_BLOCKS, size)
            quiet = np.square(inner).mean((2, 4)).min((1, 2)) / 8
        patch = patch.reshape(len(patch), patch.shape[1] // 2, 2, -1, 2).mean((2, 4))
    return out, quiet


def tangents(normal: Floats) -> tuple[Floats, Floats]:
    """(n, 3) unit vectors each, at right angles to the normals and to each other."""
    aside = np.where(np.abs(normal[:, :1]) < 0.6, [[1, 0, 0]], [[0, 1, 0]]).astype(np.float32)
    first = np.cross(normal, aside)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), np.float32(1e-20))
    return first, np.cross(normal, first)


def across(places: Owners, camera: Camera) -> Floats:
    """(n,) pixels of the photo per point in the direction in which it is foreshortened."""
    return resolution(places, camera) * np.maximum(facing(places, camera), 0)


def columns(detail: Detail) -> tuple[NDArray[Any], ...]:
    """The arrays in the order of the fields."""
    return tuple(vars(detail).values())


def chosen(detail: Detail, which: NDArray[np.bool_]) -> Detail:
    """Some of the measurements."""
    return Detail(*(column[which] for column in columns(detail)))
