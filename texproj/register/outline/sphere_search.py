"""From where does the mesh have this outline? A search over the full sphere of views."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texproj.arrays import Doubles, Mask
from texproj.camera import Camera, Intrinsics, Pose
from texproj.mesh import Mesh, face_areas
from texproj.register.motion import motion_px
from texproj.register.structure.starts import placed_pose
from texproj.solve.placement import Placement
from texproj.solve.silhouette import Signature, best_turns, sphere_directions, splatted

POINTS = 15_000
"""Surface points whose images make an outline: several per pixel of the search."""
TURNS_EACH = 3
"""Turns about the line of sight that are kept of each view."""
DISTINCT = 0.05
"""Image motion, as a share of the width, from which on two cameras are two hypotheses."""
PROBES = 200


@dataclass(frozen=True, eq=False)
class OutlineView:
    """A camera (of the mask's size) from which the outline is about right, and how well."""

    camera: Camera
    overlap: float


def surface_points(mesh: Mesh, count: int, seed: int = 0) -> Doubles:
    """(count, 3) points spread evenly over the surface by area."""
    rng = np.random.default_rng(seed)
    areas = face_areas(mesh)
    faces = rng.choice(len(areas), count, p=areas / areas.sum())
    a, b = np.sort(rng.random((2, count)), axis=0)
    weights = np.stack([a, b - a, 1 - b], axis=1)
    out: Doubles = np.einsum("nk,nkd->nd", weights, mesh.vertices[mesh.faces[faces]])
    return out


def views_with_outline(
    mask: Mask, lens: Intrinsics, mesh: Mesh, views: int, most: int
) -> list[OutlineView]:
    """Up to `most` distinct cameras, the likeliest first, from which `mesh` looks like `mask`.

    lens: of the mask's size; what is cut off by the picture's border is not allowed for.
    """
    wanted = Signature.of(mask)
    if wanted is None:
        return []
    xyz = surface_points(mesh, POINTS)
    cameras = _round(mesh, lens, wanted.radius_px, views)
    shown = [Signature.of(splatted(c.project(xyz)[0], lens.width, lens.height)) for c in cameras]
    seen = [(c, s) for c, s in zip(cameras, shown, strict=True) if s is not None]
    polar = np.stack([s.polar for _, s in seen])
    found: list[OutlineView] = []
    probes = xyz[:PROBES]
    for overlap, view, roll in best_turns(wanted, polar, TURNS_EACH):
        camera, signature = seen[view]
        start = _placed(camera, signature, wanted, roll, mesh)
        if all(motion_px(start, f.camera, probes) > DISTINCT * lens.width for f in found):
            found.append(OutlineView(start, overlap))
        if len(found) == most:
            break
    return found


def _round(mesh: Mesh, lens: Intrinsics, radius_px: float, views: int) -> list[Camera]:
    """Cameras all around that see the mesh at about the wanted size."""
    spread = float(np.sqrt(((mesh.vertices - mesh.center) ** 2).sum(axis=1).mean()))
    distance = max(lens.fx * spread / radius_px, 0.6 * mesh.diagonal)
    middle = replace(lens.pinhole, cx=lens.width / 2, cy=lens.height / 2)
    return [
        Camera(middle, Pose.look_at(mesh.center + distance * d, mesh.center))
        for d in sphere_directions(views)
    ]


def _placed(camera: Camera, shown: Signature, wanted: Signature, roll: float, mesh: Mesh) -> Camera:
    scale = wanted.radius_px / shown.radius_px
    depth = float(camera.pose.apply(mesh.center[None])[0, 2])
    x, y = wanted.center_px - shown.center_px
    pose = placed_pose(camera, Placement(0, roll, scale, (x, y)), shown.center_px, depth)
    return replace(camera, pose=pose)
