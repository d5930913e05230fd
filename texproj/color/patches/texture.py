"""A texture of patches, each cut from the one photo that shows its surface best.

After Callieri, Cignoni, Scopigno, "Reconstructing textured meshes from multiple range rgb maps",
VMV 2002, and Waechter, Moehrle, Goesele, "Let there be color!", ECCV 2014. Ours: the choice is
led by what all photos agree on, so that occluders in front of the surface are not chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.balance.corrections import Gains
from texproj.color.balance.photometry import Photometry, solve_photometry
from texproj.color.balance.shared_points import Surveyor
from texproj.color.checker.apply import absolute_matrix, in_absolute
from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import fill_unseen
from texproj.color.patches.charts import continued, patch_atlas
from texproj.color.patches.cut import Shots, cut
from texproj.color.patches.labels import Labels, choose_photos, merge_islands
from texproj.color.patches.seams import PatchBlends
from texproj.color.patches.views import FacePoints, FaceViews, face_views, survey_options
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture
from texproj.color.sampling.depth_images import Depths
from texproj.color.sampling.gather import LoadPhoto, Progress, project_views, views_ahead
from texproj.color.sampling.store import Spill
from texproj.color.texture import encoded
from texproj.mesh import Mesh, face_areas
from texproj.options import ColorOptions, PatchOptions, UnwrapOptions
from texproj.photo import srgb_from_linear
from texproj.render import Renderer
from texproj.resources.memory import return_freed_memory, trim
from texproj.resources.scratch import Scratch
from texproj.resources.threads import in_parallel, opencv_in_one_thread
from texproj.unwrap.atlas import Atlas
from texproj.unwrap.regions import DualGraph, dual_graph

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
        shots = Shots(cameras, load_photo, depths, replace(settings.color, blend="robust"))
        views, light, absolute, checker = _surveyed(mesh, shots, settings, scratch, steps)
        trim()
        graph = dual_graph(mesh)
        labels = _labels(mesh, views, graph, patch)
        blends = PatchBlends(mesh, labels, views, patch)
        atlas = patch_atlas(mesh, graph, cameras, labels, views.density, settings.unwrap)
        texels = TexelPoints.of(mesh, atlas, scratch, continued(mesh, atlas, graph))
        pixels = cut(texels, atlas, blends, light, shots, steps.second)
        del views, blends, shots, graph  # before the pages are made
        trim()
        pages, counts = _bake(texels, atlas, pixels, absolute, settings.color)
        fill_unseen(mesh, atlas, texels, pages, counts)
        for number, page in enumerate(pages):
            fill_page(page, texels.inside(number, page.shape))
    quality = quality_of(mesh, atlas, labels, light.gains) | checker
    return Texture(atlas, tuple(pages), tuple(counts), quality)


def _surveyed(
    mesh: Mesh, shots: Shots, settings: PatchSettings, scratch: Scratch, steps: _Steps
) -> tuple[FaceViews, Photometry, Floats | None, dict[str, Any]]:
    """What the photos show of each face; their light; the matrix to absolute color, if any, and
    what to report of it.
    """
    survey, points = survey_options(settings.color), FacePoints.of(mesh, len(shots.cameras))
    shown = views_ahead(shots.cameras, shots.load_photo, shots.depths, survey)
    count = len(shots.cameras)
    surveyor = Surveyor(points, count, survey.focus_power > 0)
    spill = project_views(points, shown, surveyor, count, survey, scratch, steps.first)
    evidence = surveyor.survey()
    light = solve_photometry(evidence, settings.color)
    absolute, checker = absolute_matrix(settings.color, evidence, light)
    views = face_views(points, shots.cameras, spill, light, settings.color, settings.patch)
    return views, light, absolute, checker


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


def _labels(mesh: Mesh, views: FaceViews, graph: DualGraph, patch: PatchOptions) -> Labels:
    areas = face_areas(mesh)
    labels = choose_photos(mesh, views, graph, patch)
    area_px = (areas * views.density**2).astype(np.float32)
    return merge_islands(labels, views, graph, area_px, patch.smallest_px)


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
