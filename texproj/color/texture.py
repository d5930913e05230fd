"""A texture blended from all photos."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.alignment.projection import Coming
from texproj.color.alignment.shift import (
    Alignment,
    alignments,
    failures,
    per_alignment,
    rough,
)
from texproj.color.balance.corrections import gains_of, grids_of
from texproj.color.balance.focus import solve_photos
from texproj.color.balance.photometry import Photometry
from texproj.color.balance.shared_points import PointObserver
from texproj.color.blending.combine import blend_chunk
from texproj.color.blending.preference import decided
from texproj.color.checker.apply import absolute_matrix, in_absolute
from texproj.color.checker.fit import Checker
from texproj.color.filling.gutters import fill_page
from texproj.color.filling.texels import fill_unseen
from texproj.color.points.texels import TexelPoints
from texproj.color.quality import coverage, per_lens, per_photo
from texproj.color.result import Texture
from texproj.color.sampling.gather import Progress, counting
from texproj.color.sampling.part import Unusable
from texproj.color.sampling.photo_set import PhotoSet, reasons
from texproj.color.sampling.resolution import texels_per_unit
from texproj.color.sampling.store import SampleStore
from texproj.mesh import Mesh
from texproj.options import ColorOptions, UnwrapOptions
from texproj.photo import srgb_from_linear
from texproj.render import Renderer
from texproj.resources.memory import return_freed_memory, trim
from texproj.resources.scratch import Scratch
from texproj.resources.threads import in_parallel, opencv_in_one_thread
from texproj.unwrap.atlas import Atlas
from texproj.unwrap.kept import kept_atlas, kept_pages
from texproj.unwrap.parts import Regions
from texproj.unwrap.unwrap import unwrap

ENCODING = np.round(srgb_from_linear(np.arange(65536) / 65535) * 255).astype(np.uint8)
"""8-bit sRGB of 16-bit linear light."""


def color_texture(
    mesh: Mesh,
    photos: PhotoSet,
    renderer: Renderer,
    options: ColorOptions | None = None,
    unwrap_options: UnwrapOptions | None = None,
    checker: Checker | None = None,
    progress: Progress | None = None,
) -> Texture:
    """Unwrap the mesh, or keep its own layout, and blend all photos into its texture.

    photos: each is read once, three times with `options.align`; checker: what a color chart says,
    for absolute colors; progress: called with photos done and photos in all.
    """
    options, unwrap_options = options or ColorOptions(), unwrap_options or UnwrapOptions()
    kept, note = kept_pages(mesh, unwrap_options)
    found, names = found_alignments(mesh, photos, renderer, options), photos.names
    return_freed_memory()
    with opencv_in_one_thread(), closing(Scratch()) as scratch:
        with ThreadPoolExecutor(1) as beside:
            regions = None if kept else beside.submit(Regions.of, mesh, unwrap_options)
            photos = photos.seen_on(mesh, renderer, scratch)
            renderer.rest()
            density = texels_per_unit(mesh, photos, options)
        trim()
        coming = Coming(photos, options, found)
        if kept:
            atlas = kept_atlas(mesh, kept, density, unwrap_options)
        else:
            atlas = unwrap(mesh, density, unwrap_options, regions.result() if regions else None)
        points = TexelPoints.of(mesh, atlas, scratch)
        trim()
        observer = PointObserver(points, len(photos), options.focus_power > 0)
        tell = counting(progress, len(photos))
        projected = coming.project(points, observer, scratch, tell)
        shared = observer.shared()
        trim()
        light, focus = solve_photos(shared, options)
        absolute, charted = absolute_matrix(checker, names, shared, light)
        samples, cameras = projected.samples, photos.cameras
        gains, grids = gains_of(light.corrections), grids_of(cameras, light.corrections)
        chosen = decided(samples, points, gains, grids, options)
        pages, counts, share = bake(points, atlas, samples, cameras, light, absolute, chosen)
        fill_unseen(mesh, atlas, points, pages, counts)
        for number, page in enumerate(pages):
            fill_page(page, points.inside(number, page.shape))
    failed = reasons(failures(found), projected.failed)
    quality = coverage(counts, sum(points.sizes)) | charted | per_alignment(names, found)
    quality |= {"behind": photos.seen_from_behind, "preference": chosen.preference}
    quality |= {"photos": per_photo(names, light, focus, share, failed)}
    quality |= {"lenses": per_lens(names, light), "atlas": asdict(atlas.stats)}
    notes = (note,) if note else ()
    return Texture(atlas, tuple(pages), tuple(counts), quality, failed, kept, notes)


def found_alignments(
    mesh: Mesh, photos: PhotoSet, renderer: Renderer, options: ColorOptions
) -> tuple[Alignment | Unusable, ...]:
    """The displacements of all photos against a first coloring; none where they are not wanted."""
    if not options.align:
        return ()
    first = color_texture(mesh, photos, renderer, rough(options))
    return alignments(mesh, first, photos, renderer)


def bake(
    points: TexelPoints,
    atlas: Atlas,
    store: SampleStore,
    cameras: Sequence[Camera],
    light: Photometry,
    absolute: Floats | None,
    options: ColorOptions,
) -> tuple[list[NDArray[Any]], list[NDArray[np.uint8]], NDArray[np.float64]]:
    """Blend the samples of all photos: pages, photo counts, and each photo's part of the colors in
    texels. What is unseen stays 0. absolute: (3, 3) matrix on the blended light, if any.
    """
    kind = np.uint8 if options.bits == 8 else np.uint16
    pages = [np.zeros((h, w, 3), kind) for w, h in atlas.page_sizes]
    counts = [np.zeros((h, w), np.uint8) for w, h in atlas.page_sizes]
    gains, grids = gains_of(light.corrections), grids_of(cameras, light.corrections)
    shares = np.zeros((len(points.tiles), len(gains)))

    def one(number: int) -> None:
        result = blend_chunk(store, points, number, gains, grids, options)
        page = points.tiles[number].page
        points.place(number, pages[page], encoded(in_absolute(result.rgb, absolute), options.bits))
        points.place(number, counts[page], np.minimum(result.photo_count, 255).astype(np.uint8))
        shares[number] = result.share

    in_parallel(one, range(len(points.tiles)))
    return pages, counts, shares.sum(axis=0)


def encoded(rgb: Floats, bits: int) -> NDArray[Any]:
    """(n, 3) linear light to sRGB of 8 or 16 bit."""
    if bits == 8:
        return ENCODING[(np.clip(rgb, 0, 1) * 65535).astype(np.uint16)]
    return np.round(srgb_from_linear(rgb) * 65535).astype(np.uint16)
