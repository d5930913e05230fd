"""What one photo's weight is at every vertex, by the functions of the color stage."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.color.points.source import VertexPoints
from texproj.color.sampling.prepare import photo_view
from texproj.color.sampling.sample import sample
from texproj.color.weights.surface import surface_view
from texproj.photo import Photo
from texproj.stages.bench import Workbench


def vertex_weights(bench: Workbench, photo: Photo, camera: Camera) -> NDArray[np.float32]:
    """(V,) product of the weight factors of one photo, 0 = unseen."""
    options = bench.project.settings.color
    view = photo_view(photo, camera, bench.scene, options)
    points = VertexPoints.of(bench.mesh)
    surface = surface_view(points.owners, view.camera, view.depth_camera, len(view.levels), options)
    parts = []
    for number, size in enumerate(points.sizes):
        part = np.zeros(size, np.float32)
        samples = sample(points.chunk(number), surface, view)
        if samples is not None:
            part[samples.seen] = samples.weight
        parts.append(part)
    return np.concatenate(parts)
