"""How many texels the photos are worth, face by face."""

from __future__ import annotations

from threading import Lock

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.points.source import Chunk, Owners
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.sampling.sample import project
from texproj.color.sampling.view import PhotoView
from texproj.color.weights.surface import facing, resolution, surface_view
from texproj.mesh import Mesh, blocks, face_areas
from texproj.options import ColorOptions
from texproj.resources.threads import in_parallel
from texproj.unwrap.stretch import weighted_quantiles

UNSEEN = 0.25
"""Texels per unit of faces that no photo sees, against the median of the others."""

CLOSEST = 0.98
"""Part of the surface that gets the full resolution of its best photo: a few faces right in front
of a camera do not decide the size of the texture."""


def texels_per_unit(mesh: Mesh, photos: PhotoSet, options: ColorOptions) -> NDArray[np.float64]:
    """(F,) texels per mesh unit: pixels of the photo that resolves the face best, times
    `options.texels_per_pixel`.
    """
    spacing = np.ones(len(mesh.faces), np.float32)  # so that `resolution` is pixels per unit
    faces, lock = Owners.of_faces(mesh, spacing), Lock()
    best = np.zeros(len(mesh.faces))

    def one(number: int) -> None:
        depth_camera, depth = photos.depth_image(number)
        view = PhotoView(photos.cameras[number], depth_camera, depth)
        for rows in blocks(len(best)):
            better, pixels = _better(faces.part(rows), best[rows], view, options)
            with lock:
                best[rows][better] = np.maximum(best[rows][better], pixels)

    in_parallel(one, range(len(photos)))
    seen = best > 0
    if not seen.any():
        return np.ones(len(best))
    area = face_areas(mesh)
    middle, closest = weighted_quantiles(best[seen], area[seen], (0.5, CLOSEST))
    best = np.minimum(best, closest)
    best[~seen] = UNSEEN * middle
    return best * options.texels_per_pixel


def _better(
    faces: Owners, best: NDArray[np.float64], view: PhotoView, options: ColorOptions
) -> tuple[NDArray[np.int32], Floats]:
    """(n,) rows of the faces that a photo may resolve better than `best` (k,), and its pixels per
    unit there, 0 where it does not show them.
    """
    surface = surface_view(faces, view.camera, view.depth_camera, 1, options)
    pixels = resolution(faces, view.camera) * np.sqrt(np.maximum(facing(faces, view.camera), 0))
    better = np.flatnonzero(np.where(surface.weight > 0, pixels, 0) > best).astype(np.int32)
    weight = surface.weight.take(better)
    if len(better):
        project(Chunk(faces.center.take(better, axis=0), better), weight, surface, view)
    return better, np.where(weight > 0, pixels[better], np.float32(0))
