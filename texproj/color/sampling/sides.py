"""Whether the photos see the surface from its outside."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Bools, Doubles, Floats
from texproj.camera import Camera
from texproj.color.sampling.depth_images import DepthImages
from texproj.errors import InputError
from texproj.mesh import Mesh, face_cross

FACES, CAMERAS = 20_000, 16
"""How many are looked at, spread over all."""

MOST_BEHIND = 0.9
"""Part of the surface seen that may be seen from behind: thin parts and holes show some."""

NEAR = 0.01
"""A face's center is seen where its depth differs from the depth image by this part at most."""


def seen_from_behind(mesh: Mesh, depths: DepthImages) -> float:
    """The part of what the cameras see of the mesh that is the back of its faces, where nothing
    gets a color. Raises InputError for a mesh of which they see little else.
    """
    faces = mesh.faces[:: max(1, len(mesh.faces) // FACES)]
    center, normal = mesh.vertices[faces].mean(axis=1), face_cross(mesh.vertices, faces)
    seen = np.zeros(2)
    for number in range(0, len(depths.stored), max(1, len(depths.stored) // CAMERAS)):
        camera, depth = depths.read(number)
        towards = ((camera.center - center) * normal).sum(axis=1)
        towards /= np.maximum(np.linalg.norm(camera.center - center, axis=1), 1e-300)
        shown = towards[_shown(camera, depth, center)]
        seen += shown[shown > 0].sum(), -shown[shown < 0].sum()
    behind = float(seen[1] / max(seen.sum(), 1e-300))
    if behind > MOST_BEHIND:
        raise InputError(
            f"the faces of the mesh look away from the photos: {behind:.0%} of what is seen of it"
            " is its back, which gets no color; turn them over (MeshLab: Filters, Normals, Invert"
            " Faces Orientation)"
        )
    return behind


def _shown(camera: Camera, depth: Floats, points: Doubles) -> Bools:
    """(n,) which points (n, 3) the camera of a depth image sees."""
    xy_px, z = camera.project(points)
    inside = camera.inside(xy_px)
    column, row = np.where(inside[:, None], xy_px, 0).astype(int).T
    return inside & (np.abs(z - depth[row, column]) < NEAR * z)
