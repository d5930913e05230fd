"""One color per vertex."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texproj.camera import Camera
from texproj.color.combine import weighted_mean
from texproj.color.fill import fill_vertices
from texproj.color.points import chunks, vertex_points
from texproj.color.project import LoadPhoto, Progress, project_photos
from texproj.color.result import VertexColors
from texproj.color.view import MeshRenderer
from texproj.mesh import Mesh
from texproj.options import ColorOptions


def color_vertices(
    mesh: Mesh,
    cameras: Sequence[Camera],
    load_photo: LoadPhoto,
    renderer: MeshRenderer,
    options: ColorOptions | None = None,
    progress: Progress | None = None,
) -> VertexColors:
    """Blend all photos into one color per vertex.

    cameras: of the full-size photos; load_photo: decodes the photo of a number in `cameras`, is
    called once per photo; progress: called with photos done and photos in all.
    """
    options = options or ColorOptions()
    points = vertex_points(mesh)
    rgb = np.zeros((len(points), 3), np.float32)
    weight = np.zeros(len(points), np.float32)
    count = np.zeros(len(points), np.uint16)
    with (
        renderer.load(mesh) as scene,
        project_photos(points, cameras, load_photo, scene, options, progress) as spill,
    ):
        for chunk, part in enumerate(chunks(len(points))):
            blend = weighted_mean(spill.read(chunk))
            rgb[part], weight[part], count[part] = blend.rgb, blend.weight, blend.photo_count
    quality = {"seen": float((weight > 0).mean())}
    return VertexColors(fill_vertices(mesh, rgb, weight > 0), weight, count, quality)
