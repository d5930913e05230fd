"""A texture of patches, each cut from the one photo that shows its surface best.

After Callieri, Cignoni, Scopigno, "Reconstructing textured meshes from multiple range rgb maps",
VMV 2002, and Waechter, Moehrle, Goesele, "Let there be color!", ECCV 2014. Ours: the choice is
led by what all photos agree on, so that occluders in front of the surface are not chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.alignment.projection import Coming
from texproj.color.balance.corrections import Gains
from texproj.color.balance.photometry import Photometry, solve_photometry
from texproj.color.balance.shared_points import PointObserver, SharedPoints
from texproj.color.checker.apply import absolute_matrix, in_absolute
from texproj.color.checker.fit import Checker
from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import fill_unseen
from texproj.color.patches.charts import continued, patch_atlas
from texproj.color.patches.cut import cut
from texproj.color.patches.labels import Labels, choose_photos, merge_islands
from texproj.color.patches.seams import PatchBlends
from texproj.color.patches.views import FacePoints, FaceViews, face_views, sampling_options
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture
from texproj.color.sampling.gather import Progress, counting
from texproj.color.sampling.part import Unusable
from texproj.color.sampling.photo_set import PhotoSet, reasons
from texproj.color.sampling.store import SampleStore
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
    photos: PhotoSet,
    renderer: Renderer,
    settings: PatchSettings | None = None,
    checker: Checker | None = None,
    progress: Progress | None = None,
) -> Texture:
    """Cut the surface into patches of one photo each and lay their pixels on pages.

    photos: each is read twice; checker: what a color chart says, for absolute colors; progress:
    called with steps done and steps in all, two per photo.
    """
    settings = settings or PatchSettings()
    options, patch, steps = settings.color, settings.patch, 2 * len(photos)
    return_freed_memory()
    with opencv_in_one_thread(), closing(Scratch()) as scratch:
        photos = photos.seen_on(mesh, renderer, scratch)
        seen = _evidence(mesh, photos, settings, scratch, counting(progress, steps))
        absolute, charted = absolute_matrix(checker, photos.names, seen.shared, seen.light)
        trim()
        views, graph = seen.views, dual_graph(mesh)
        labels = _labels(mesh, views, graph, patch)
        blends = PatchBlends(mesh, labels, views, patch)
        atlas = patch_atlas(mesh, graph, photos.cameras, labels, views.density, settings.unwrap)
        texels = TexelPoints.of(mesh, atlas, scratch, continued(mesh, atlas, graph))
        light, failed = seen.light, seen.failed
        del views, seen, graph  # before the pixels are cut
        robust, tell = replace(options, blend="robust"), counting(progress, steps, len(photos))
        pixels = cut(texels, atlas, blends, light, photos, robust, tell)
        del blends  # before the pages are made
        trim()
        pages, counts = _bake(texels, atlas, pixels.samples, absolute, options)
        fill_unseen(mesh, atlas, texels, pages, counts)
        for number, page in enumerate(pages):
            fill_page(page, texels.inside(number, page.shape))
    why = reasons(failed, pixels.failed)
    quality = quality_of(mesh, atlas, labels) | charted | {"behind": photos.seen_from_behind}
    quality |= {"photos": per_patched_photo(mesh, labels, photos.names, light.gains, why)}
    return Texture(atlas, tuple(pages), tuple(counts), quality, why)


@dataclass(frozen=True, eq=False)
class _Evidence:
    """What the photos show of each face, what all show of the same points, their light, and the
    photos that could not be used.
    """

    views: FaceViews
    shared: SharedPoints
    light: Photometry
    failed: tuple[Unusable, ...]


def _evidence(
    mesh: Mesh,
    photos: PhotoSet,
    settings: PatchSettings,
    scratch: Scratch,
    progress: Callable[[int], None],
) -> _Evidence:
    options, points = sampling_options(settings.color), FacePoints.of(mesh, len(photos))
    observer = PointObserver(points, len(photos), options.focus_power > 0)
    projected = Coming(photos, options).project(points, observer, scratch, progress)
    shared = observer.shared()
    light = solve_photometry(shared, settings.color)
    cameras, samples = photos.cameras, projected.samples
    views = face_views(points, cameras, samples, light, settings.color, settings.patch)
    return _Evidence(views, shared, light, projected.failed)


def _labels(mesh: Mesh, views: FaceViews, graph: DualGraph, patch: PatchOptions) -> Labels:
    areas = face_areas(mesh)
    labels = choose_photos(mesh, views, graph, patch)
    area_px = (areas * views.density**2).astype(np.float32)
    return merge_islands(labels, views, graph, area_px, patch.smallest_px)


def _bake(
    texels: TexelPoints,
    atlas: Atlas,
    pixels: SampleStore,
    absolute: Floats | None,
    options: ColorOptions,
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


def quality_of(mesh: Mesh, atlas: Atlas, labels: Labels) -> dict[str, Any]:
    """Numbers for the report."""
    area = face_areas(mesh)
    return {
        "seen": float(area[labels >= 0].sum()) / max(float(area.sum()), 1e-300),
        "patches": len(np.unique(atlas.chart_of_face[labels >= 0])),
        "cut_for_overlap": atlas.stats.overlap_splits,
        "scale": round(atlas.stats.scale, 4),
        "atlas": asdict(atlas.stats),
    }


def per_patched_photo(
    mesh: Mesh, labels: Labels, names: Sequence[str], gains: Gains, failed: Mapping[str, str]
) -> list[dict[str, Any]]:
    """One entry per photo that was used.

    file: its name; gain: factor on each channel of linear light; spread: median absolute log
    difference to the other photos after correction; share: part of the surface that it colors.
    """
    area = face_areas(mesh)
    total = max(float(area.sum()), 1e-300)
    return [
        {
            "file": name,
            "gain": [round(float(g), 4) for g in factor],
            "spread": round(float(spread), 4),
            "share": round(float(area[labels == number].sum()) / total, 4),
        }
        for number, (name, factor, spread) in enumerate(
            zip(names, gains.factor, gains.spread, strict=True)
        )
        if name not in failed
    ]
