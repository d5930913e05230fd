"""A texture of patches, each cut from the one photo that shows its surface best.

After Callieri, Cignoni, Scopigno, "Reconstructing textured meshes from multiple range rgb maps",
VMV 2002, and Waechter, Moehrle, Goesele, "Let there be color!", ECCV 2014. Ours: the choice is
led by what all photos agree on, so that occluders in front of the surface are not chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.color.absolute import absolute_matrix, in_absolute
from texproj.color.atlas import Atlas
from texproj.color.corrections import Correction, Grid, factors_at, grid_of
from texproj.color.depths import Depths
from texproj.color.gains import Gains
from texproj.color.memory import return_freed_memory
from texproj.color.pages import fill_page
from texproj.color.patch_charts import continued, patch_atlas
from texproj.color.patch_labels import Labels, choose_photos, merge_islands
from texproj.color.patch_seams import PatchBlend, PatchBlends
from texproj.color.patch_views import FacePoints, FaceViews, face_views, survey_options
from texproj.color.photometry import Photometry, solve_photometry
from texproj.color.points import Floats
from texproj.color.prepare import view_of
from texproj.color.project import LoadPhoto, Progress, project_views, views_ahead
from texproj.color.result import Texture
from texproj.color.sample import Samples, sample
from texproj.color.scratch import Scratch
from texproj.color.segmentation import DualGraph, dual_graph
from texproj.color.sight import Sight, sight_of
from texproj.color.spill import Spill
from texproj.color.texels import TexelPoints
from texproj.color.texture import encoded
from texproj.color.threads import ahead, in_parallel, opencv_in_one_thread
from texproj.color.unseen import fill_unseen
from texproj.color.view import WHITE, PhotoView
from texproj.mesh import Mesh, face_areas
from texproj.options import ColorOptions, PatchOptions, UnwrapOptions
from texproj.photo import srgb_from_linear
from texproj.render import Renderer

ENCODING = srgb_from_linear((np.arange(65536) / 65535) ** 2)
"""sRGB of the 16-bit square root of linear light."""


@dataclass(frozen=True)
class PatchSettings:
    """All options of `color_patches`."""

    color: ColorOptions = field(default_factory=ColorOptions)
    patch: PatchOptions = field(default_factory=PatchOptions)
    unwrap: UnwrapOptions = field(default_factory=UnwrapOptions)


def color_patches(
    mesh: Mesh,
    cameras: Sequence[Camera],
    load_photo: LoadPhoto,
    renderer: Renderer,
    settings: PatchSettings | None = None,
    progress: Progress | None = None,
) -> Texture:
    """Cut the surface into patches of one photo each and lay their pixels on pages.

    cameras: of the full-size photos; load_photo: decodes the photo of a number in `cameras`, is
    called twice per photo; progress: called with steps done and steps in all, two per photo.
    """
    settings = settings or PatchSettings()
    survey, patch = survey_options(settings.color), settings.patch
    steps = _Steps(len(cameras), progress)
    return_freed_memory()
    with opencv_in_one_thread(), closing(Scratch()) as scratch:
        with renderer.load(mesh) as scene:
            depths = Depths.of(cameras, scene, survey, scratch)
        points = FacePoints.of(mesh)
        shots = _Shots(cameras, load_photo, depths, settings.color)
        shown = views_ahead(cameras, load_photo, depths, survey)
        spill, evidence = project_views(points, shown, len(cameras), survey, scratch, steps.first)
        light = solve_photometry(evidence, settings.color)
        absolute, checker = absolute_matrix(settings.color, evidence, light)
        gains = light.gains
        views = face_views(points, cameras, spill, light, settings.color, patch)
        graph = dual_graph(mesh)
        labels = _labels(mesh, views, graph, patch)
        blends = PatchBlends(mesh, labels, views, patch)
        atlas = patch_atlas(mesh, graph, cameras, labels, views.density, settings.unwrap)
        texels = TexelPoints.of(mesh, atlas, scratch, continued(mesh, atlas, graph))
        pixels = _cut(texels, mesh, atlas, blends, light, shots, steps)
        del points, spill, views, blends, shots  # before the pages are made
        pages, counts = _bake(texels, atlas, pixels, absolute, settings.color)
        fill_unseen(mesh, atlas, texels, pages, counts)
        for number, page in enumerate(pages):
            fill_page(page, texels.inside(number, page.shape))
    quality = quality_of(mesh, atlas, labels, gains) | checker
    return Texture(atlas, tuple(pages), tuple(counts), quality)


@dataclass(frozen=True)
class _Steps:
    """Progress over two rounds of all photos."""

    photos: int
    progress: Progress | None

    def first(self, done: int, _: int) -> None:
        if self.progress:
            self.progress(done, 2 * self.photos)

    def second(self, done: int) -> None:
        self.first(self.photos + done, 0)


@dataclass(frozen=True, eq=False)
class _Shots:
    """Photos, ready to be sampled, one at a time."""

    cameras: Sequence[Camera]
    load_photo: LoadPhoto
    depths: Depths
    options: ColorOptions

    def view(self, number: int) -> PhotoView | None:
        photo = self.load_photo(number)
        if photo is None:
            return None
        return view_of(photo, self.cameras[number], *self.depths.read(number), self.options)


def _labels(mesh: Mesh, views: FaceViews, graph: DualGraph, patch: PatchOptions) -> Labels:
    areas = face_areas(mesh)
    labels = choose_photos(mesh, views, graph, patch)
    area_px = (areas * views.density**2).astype(np.float32)
    return merge_islands(labels, views, graph, area_px, patch.smallest_px)


def _cut(
    texels: TexelPoints,
    mesh: Mesh,
    atlas: Atlas,
    blends: PatchBlends,
    light: Photometry,
    shots: _Shots,
    steps: _Steps,
) -> Spill:
    """The pixels of every photo where it gives some: square roots of linear light, leveled."""
    pixels = Spill(texels.sizes, texels.scratch)
    maps = corner_maps(atlas)
    tiles = _tiles_of_faces(texels, len(mesh.faces))

    def make(number: int) -> tuple[PatchBlend, PhotoView | None]:
        return blends.blend(number), shots.view(blends.photos[number])

    for done, (blend, view) in enumerate(ahead(make, len(blends))):
        if view is not None:
            row = np.zeros(len(mesh.faces), np.int32)
            row[blend.faces] = np.arange(len(blend.faces), dtype=np.int32)
            used = np.zeros(len(mesh.faces), bool)
            used[blend.faces] = True
            sight = sight_of(
                texels.owners, view.camera, view.depth_camera, len(view.levels), shots.options
            )
            sight = replace(sight, weight=sight.weight * used)
            correction = light.corrections[blend.photo]
            cutter = _Cutter(texels, view, sight, maps, row, blend.corners, correction)
            wanted = [n for n, faces in enumerate(tiles) if used[faces].any()]
            in_parallel(partial(cutter.cut, blend.photo, pixels), wanted)
        del view, blend  # before the next ones are made
        steps.second(done + 1)
    return pixels


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
    sight: Sight
    maps: Floats
    row: NDArray[np.int32]
    corners: Floats
    correction: Correction

    @cached_property
    def grid(self) -> Grid | None:
        """The photo's light over the picture."""
        return grid_of(self.view.camera, self.correction)

    def cut(self, photo: int, pixels: Spill, tile: int) -> None:
        chunk = self.texels.chunk(tile)
        samples = sample(chunk, self.sight, self.view)
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


def _bake(
    texels: TexelPoints, atlas: Atlas, pixels: Spill, absolute: Floats | None, options: ColorOptions
) -> tuple[list[NDArray[Any]], list[NDArray[np.uint8]]]:
    """The pages, and how many photos each texel is from; 0 = not seen.

    absolute: (3, 3) matrix on the linear light, if any.
    """
    kind, top = (np.uint8, 255) if options.bits == 8 else (np.uint16, 65535)
    table = np.round(ENCODING * top).astype(kind)
    pages = [np.zeros((h, w, 3), kind) for w, h in atlas.page_sizes]
    counts = [np.zeros((h, w), np.uint8) for w, h in atlas.page_sizes]

    def one(number: int) -> None:
        stack = pixels.read(number)
        if len(stack.photos):
            total = stack.weight.sum(axis=0)
            share = stack.weight / np.maximum(total, np.float32(1e-20))
            root = np.einsum("pn,pcn->nc", share, stack.rgb)
            page = texels.tiles[number].page
            if absolute is None:
                colors = table[(root.clip(0, 1) * 65535).astype(np.uint16)]
            else:
                colors = encoded(in_absolute(root * root, absolute), options.bits)
            texels.place(number, pages[page], colors)
            seen = np.count_nonzero(stack.weight, axis=0).clip(0, 255).astype(np.uint8)
            texels.place(number, counts[page], seen)

    in_parallel(one, range(len(texels.tiles)))
    return pages, counts


def quality_of(mesh: Mesh, atlas: Atlas, labels: Labels, gains: Gains) -> dict[str, Any]:
    """Numbers for the report."""
    area = face_areas(mesh)
    total = max(float(area.sum()), 1e-300)
    return {
        "seen": float(area[labels >= 0].sum()) / total,
        "patches": len(np.unique(atlas.chart_of_face[labels >= 0])),
        "cut_for_overlap": atlas.stats.overlap_splits,
        "scale": round(atlas.stats.scale, 4),
        "photos": [
            {
                "gain": [round(float(g), 4) for g in factor],
                "spread": round(float(spread), 4),
                "share": round(float(area[labels == number].sum()) / total, 4),
            }
            for number, (factor, spread) in enumerate(zip(gains.factor, gains.spread, strict=True))
        ],
    }
