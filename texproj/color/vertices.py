"""One color per vertex."""

from __future__ import annotations

from contextlib import closing

import numpy as np

from texproj.color.alignment.projection import Coming
from texproj.color.alignment.shift import failures, per_alignment
from texproj.color.balance.corrections import gains_of, grids_of
from texproj.color.balance.focus import solve_photos
from texproj.color.balance.shared_points import PointObserver
from texproj.color.blending.combine import blend_chunk
from texproj.color.blending.preference import decided
from texproj.color.checker.apply import absolute_matrix, in_absolute
from texproj.color.checker.fit import Checker
from texproj.color.filling.vertices import fill_vertices
from texproj.color.points.source import VertexPoints
from texproj.color.quality import coverage, per_lens, per_photo
from texproj.color.result import VertexColors
from texproj.color.sampling.gather import Progress, counting
from texproj.color.sampling.photo_set import PhotoSet, reasons
from texproj.color.texture import found_alignments
from texproj.mesh import Mesh
from texproj.options import ColorOptions
from texproj.render import Renderer
from texproj.resources.scratch import Scratch
from texproj.resources.threads import opencv_in_one_thread


def color_vertices(
    mesh: Mesh,
    photos: PhotoSet,
    renderer: Renderer,
    options: ColorOptions | None = None,
    checker: Checker | None = None,
    progress: Progress | None = None,
) -> VertexColors:
    """Blend all photos into one color per vertex.

    photos: each is read once, three times with `options.align`; checker: what a color chart says,
    for absolute colors; progress: called with photos done and photos in all.
    """
    options = options or ColorOptions()
    found = found_alignments(mesh, photos, renderer, options)
    points, names = VertexPoints.of(mesh), photos.names
    rgb = np.zeros((len(mesh.vertices), 3), np.float32)
    weight = np.zeros(len(mesh.vertices), np.float32)
    count = np.zeros(len(mesh.vertices), np.uint16)
    share = np.zeros(len(photos))
    with opencv_in_one_thread(), closing(Scratch()) as scratch:
        photos = photos.seen_on(mesh, renderer, scratch)
        renderer.rest()
        coming = Coming(photos, options, found)
        observer = PointObserver(points, len(photos), options.focus_power > 0)
        tell = counting(progress, len(photos))
        projected = coming.project(points, observer, scratch, tell)
        shared = observer.shared()
        light, focus = solve_photos(shared, options)
        gains, grids = gains_of(light.corrections), grids_of(photos.cameras, light.corrections)
        absolute, charted = absolute_matrix(checker, names, shared, light)
        options = decided(projected.samples, points, gains, grids, options)
        for chunk in range(len(points.sizes)):
            part = points.rows(chunk)
            result = blend_chunk(projected.samples, points, chunk, gains, grids, options)
            rgb[part], weight[part] = in_absolute(result.rgb, absolute), result.weight
            count[part] = result.photo_count
            share += result.share
    failed = reasons(failures(found), projected.failed)
    quality = coverage([count], len(count)) | charted | per_alignment(names, found)
    quality |= {"behind": photos.seen_from_behind, "preference": options.preference}
    quality |= {"photos": per_photo(names, light, focus, share, failed)}
    quality |= {"lenses": per_lens(names, light)}
    filled = fill_vertices(mesh, np.sqrt(rgb), weight > 0) ** 2
    return VertexColors(filled, weight, count, quality, failed)
