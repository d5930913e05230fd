"""Whether the photos see the surface from its outside."""

from __future__ import annotations

import numpy as np

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera
from texproj.color.sampling.depth_images import DepthImages
from texproj.errors import InputError
from texproj.mesh import Mesh

FACES, CAMERAS = 20_000, 16
"""How many are looked at, spread over all."""

MOST_BEHIND = 0.9
"""Part of the surface seen that may be seen from behind: thin parts and holes show some."""

NEAR = 0.01
"""A face's center is seen where its depth differs from the depth image by this part at most."""


def refuse_backs(mesh: Mesh, depths: DepthImages) -> None:
    """Raise InputError for a mesh whose faces look away from the cameras that see them: from behind
    nothing gets a color.
    """
    corners = mesh.vertices[mesh.faces[:: max(1, len(mesh.faces) // FACES)]]
    center = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = np.zeros(2)
    for number in range(0, len(depths.stored), max(1, len(depths.stored) // CAMERAS)):
        camera, depth = depths.read(number)
        towards = ((camera.center - center) * normal).sum(axis=1)
        towards /= np.maximum(np.linalg.norm(camera.center - center, axis=1), 1e-300)
        shown = towards[_shown(camera, depth, center)]
        seen += shown[shown > 0].sum(), -shown[shown < 0].sum()
    if seen[1] > MOST_BEHIND * seen.sum():
        raise InputError(
            f"the faces of the mesh look away from the photos: {seen[1] / seen.sum():.0%} of what"
            " is seen of it is its back, which gets no color; turn them over (MeshLab: Filters,"
            " Normals, Invert Faces Orientation)"
        )


def _shown(camera: Camera, depth: Floats, points: Doubles) -> np.ndarray:
    """(n,) which points (n, 3) a camera without distortion sees, by its depth image."""
    xyz, k = camera.pose.apply(points), camera.intrinsics
    z = np.where(xyz[:, 2] > 0, xyz[:, 2], np.inf)
    column, row = (xyz[:, :2] / z[:, None] * (k.fx, k.fy) + (k.cx, k.cy)).T
    inside = np.isfinite(z) & (column >= 0) & (column < k.width) & (row >= 0) & (row < k.height)
    at = row[inside].astype(int), column[inside].astype(int)
    inside[inside] = np.abs(z[inside] - depth[at]) < NEAR * z[inside]
    return inside
