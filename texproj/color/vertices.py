"""One color per vertex."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing

import numpy as np

from texproj.camera import Camera
from texproj.color.alignment.shift import displaced, per_alignment
from texproj.color.balance.corrections import gains_of, grids_of
from texproj.color.balance.focus import solve_photos
from texproj.color.balance.shared_points import Surveyor
from texproj.color.blending.combine import blend_chunk
from texproj.color.checker.apply import absolute_matrix, in_absolute
from texproj.color.filling.vertices import fill_vertices
from texproj.color.points.source import VertexPoints
from texproj.color.quality import coverage, per_lens, per_photo
from texproj.color.result import VertexColors
from texproj.color.sampling.gather import LoadPhoto, Progress, project_views, views_in_turn
from texproj.color.texture import found_alignments
from texproj.mesh import Mesh
from texproj.options import ColorOptions
from texproj.render import Renderer
from texproj.resources.scratch import Scratch
from texproj.resources.threads import opencv_in_one_thread


def color_vertices(
    mesh: Mesh,
    cameras: Sequence[Camera],
    load_photo: LoadPhoto,
    renderer: Renderer,
    options: ColorOptions | None = None,
    progress: Progress | None = None,
) -> VertexColors:
    """Blend all photos into one color per vertex.

    cameras: of the full-size photos; load_photo: decodes the photo of a number in `cameras`, is
    called once per photo; progress: called with photos done and photos in all.
    """
    options = options or ColorOptions()
    found = found_alignments(mesh, cameras, load_photo, renderer, options)
    points = VertexPoints.of(mesh)
    rgb = np.zeros((len(mesh.vertices), 3), np.float32)
    weight = np.zeros(len(mesh.vertices), np.float32)
    count = np.zeros(len(mesh.vertices), np.uint16)
    share = np.zeros(len(cameras))
    with opencv_in_one_thread(), renderer.load(mesh) as scene, closing(Scratch()) as scratch:
        views = displaced(views_in_turn(cameras, load_photo, scene, options), found)
        surveyor = Surveyor(points, len(cameras), options.focus_power > 0)
        spill = project_views(points, views, surveyor, len(cameras), options, scratch, progress)
        survey = surveyor.survey()
        light, focus = solve_photos(survey, options)
        gains, grids = gains_of(light.corrections), grids_of(cameras, light.corrections)
        absolute, checker = absolute_matrix(options, survey, light)
        for chunk in range(len(points.sizes)):
            part = points.rows(chunk)
            result = blend_chunk(spill, points, chunk, gains, grids, options)
            rgb[part], weight[part] = in_absolute(result.rgb, absolute), result.weight
            count[part] = result.photo_count
            share += result.share
    quality = coverage([count], len(count)) | {"photos": per_photo(light, focus, share)}
    quality |= checker | {"lenses": per_lens(light)} | per_alignment(found)
    return VertexColors(fill_vertices(mesh, rgb, weight > 0), weight, count, quality)
