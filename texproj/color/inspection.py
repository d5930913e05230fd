"""Why one photo counts where it does, vertex by vertex: for looking at."""

from __future__ import annotations

import numpy as np

from texproj.camera import Camera
from texproj.color.points import Floats, VertexPoints
from texproj.color.sample import sample
from texproj.color.sight import facing, resolution, sight_of, surface_factors
from texproj.color.view import WHITE, PhotoView
from texproj.mesh import Mesh
from texproj.options import ColorOptions


def vertex_view(mesh: Mesh, view: PhotoView, options: ColorOptions) -> tuple[Floats, Floats]:
    """(V, 3) linear colors and (V,) weights of one photo as coloring has them, 0 = unseen."""
    points = VertexPoints.of(mesh)
    sight = sight_of(points.owners, view.camera, view.depth_camera, len(view.levels), options)
    rgb = np.zeros((len(mesh.vertices), 3), np.float32)
    weight = np.zeros(len(mesh.vertices), np.float32)
    for number in range(len(points.sizes)):
        samples = sample(points.chunk(number), sight, view)
        if samples is not None:
            rows = points.rows(number)
            rgb[rows][samples.seen] = samples.packed[:, :3] * np.float32(1 / WHITE)
            weight[rows][samples.seen] = samples.weight
    return rgb, weight


def vertex_factors(mesh: Mesh, camera: Camera, options: ColorOptions) -> dict[str, Floats]:
    """(V,) factors by name that depend on how a vertex is turned to the camera and how far it is;
    0 on back faces. Those of the picture are images: `pictures.picture_factors`.
    """
    owners = VertexPoints.of(mesh).owners
    cosine = facing(owners, camera)
    seen = cosine > np.float32(options.min_cos_angle)
    factors = surface_factors(
        np.where(seen, cosine, np.float32(1)), resolution(owners, camera), options
    )
    return {name: np.where(seen, factor, np.float32(0)) for name, factor in factors.items()}
