"""Texels of patches from the pixels of photos."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.balance.corrections import Correction, Grid, factors_at, grid_of
from texproj.color.balance.photometry import Photometry
from texproj.color.patches.seams import PatchBlend, PatchBlends
from texproj.color.points.texels import TexelPoints
from texproj.color.sampling.gather import Projection
from texproj.color.sampling.part import Unusable
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.sampling.sample import Samples, sample
from texproj.color.sampling.store import SampleStore
from texproj.color.sampling.view import WHITE, PhotoView
from texproj.color.weights.surface import SurfaceView, surface_view
from texproj.options import ColorOptions
from texproj.resources.memory import trim
from texproj.resources.threads import ahead, in_parallel
from texproj.unwrap.atlas import Atlas


def cut(
    texels: TexelPoints,
    atlas: Atlas,
    blends: PatchBlends,
    light: Photometry,
    photos: PhotoSet,
    options: ColorOptions,
    progress: Callable[[int], None],
) -> Projection:
    """The pixels of every photo where it gives some: square roots of linear light, leveled."""
    pixels, failed = SampleStore(texels.sizes, texels.scratch), []
    cutting = _Cutting(texels, corner_maps(atlas), _tiles_of_faces(texels, len(atlas.faces)))

    def make(number: int) -> tuple[PatchBlend, PhotoView | Unusable]:
        return blends.blend(number), photos.view(blends.photos[number], options)

    for done, (blend, view) in enumerate(ahead(make, len(blends))):
        if isinstance(view, Unusable):
            failed.append(view)
        else:
            cutting.add(pixels, blend, view, light.corrections[blend.photo], options)
        del view, blend  # before the next ones are made
        trim()
        progress(done + 1)
    return Projection(pixels, tuple(failed))


@dataclass(frozen=True, eq=False)
class _Cutting:
    """What is the same for all photos. maps: see `corner_maps`; faces: those of each tile."""

    texels: TexelPoints
    maps: Floats
    faces: list[NDArray[np.intp]]

    def add(
        self,
        pixels: SampleStore,
        blend: PatchBlend,
        view: PhotoView,
        correction: Correction,
        options: ColorOptions,
    ) -> None:
        """The texels of one photo."""
        row = np.full(len(self.maps), -1, np.int32)
        row[blend.faces] = np.arange(len(blend.faces), dtype=np.int32)
        camera, levels = view.camera, len(view.levels)
        surface = surface_view(self.texels.owners, camera, view.depth_camera, levels, options)
        surface = replace(surface, weight=surface.weight * (row >= 0))
        cutter = _Cutter(self.texels, view, surface, self.maps, row, blend.corners, correction)
        wanted = [n for n, faces in enumerate(self.faces) if (row[faces] >= 0).any()]
        in_parallel(partial(cutter.cut, blend.photo, pixels), wanted)


def _tiles_of_faces(texels: TexelPoints, faces: int) -> list[NDArray[np.intp]]:
    """The faces of each tile."""
    out = []
    for number in range(len(texels.tiles)):
        present = np.zeros(faces, bool)
        present[texels.chunk(number).owner] = True
        out.append(np.flatnonzero(present))
    return out


@dataclass(frozen=True, eq=False)
class _Cutter:
    """Takes the texels of a tile from one photo.

    maps: see `corner_maps`; row: (F,) int32 rows of `corners`: (m, 3, 4) weight and offset;
    correction: the photo's gain and light.
    """

    texels: TexelPoints
    view: PhotoView
    surface: SurfaceView
    maps: Floats
    row: NDArray[np.int32]
    corners: Floats
    correction: Correction

    @cached_property
    def grid(self) -> Grid | None:
        """The photo's light over the picture."""
        return grid_of(self.view.camera, self.correction)

    def cut(self, photo: int, pixels: SampleStore, tile: int) -> None:
        chunk = self.texels.chunk(tile)
        samples = sample(chunk, self.surface, self.view)
        if samples is None:
            return
        face = chunk.owner[samples.seen]
        place = self.texels.tiles[tile]
        row, column = np.nonzero(self.texels.mask(tile))
        x = column[samples.seen] + np.float32(place.columns.start + 0.5)
        y = row[samples.seen] + np.float32(place.rows.start + 0.5)
        values = at_texels(self.maps[face], self.corners[self.row[face]], x, y)
        weight = samples.packed[:, 3] * np.clip(values[:, 0], 0, 1)
        used = weight > 0
        if not used.any():
            return
        rgb = samples.packed[:, :3].astype(np.float32)
        rgb *= self.correction.gain * np.float32(1 / WHITE)
        if self.grid is not None:
            rgb *= factors_at(chunk, self.texels.owners.origin, self.grid)[samples.seen, :1]
        root = np.sqrt(rgb) + values[:, 1:]
        packed = np.empty_like(samples.packed)
        packed[:, :3] = np.clip(root * np.float32(WHITE), 0, 65535)
        packed[:, 3] = np.maximum(weight, 1)
        seen = samples.seen.copy()
        seen[seen] = used
        pixels.add(photo, tile, Samples(seen, packed[used]))


def corner_maps(atlas: Atlas) -> Floats:
    """(F, 6) float32: first corner on the page, and the rows that turn a step on the page into
    the second and third barycentric coordinates.
    """
    uv = atlas.uv_px[atlas.faces]
    (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    det = a * d - b * c
    det = np.where(np.abs(det) > 1e-12, det, np.inf)
    return np.column_stack([uv[:, 0], d / det, -c / det, -b / det, a / det]).astype(np.float32)


def at_texels(maps: Floats, values: Floats, x: Floats, y: Floats) -> Floats:
    """(n, k) linear interpolation of values (n, 3, k) at the corners to positions on the page."""
    dx, dy = x - maps[:, 0], y - maps[:, 1]
    s = (maps[:, 2] * dx + maps[:, 3] * dy)[:, None]
    t = (maps[:, 4] * dx + maps[:, 5] * dy)[:, None]
    first = values[:, 0]
    return first + s * (values[:, 1] - first) + t * (values[:, 2] - first)
