"""Points that were picked in other photos, where they should lie in this one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.errors import TexprojError
from texproj.photo import Photo
from texproj.preview.door import leaves
from texproj.preview.picking import predict_on_photo
from texproj.preview.surface import Surface
from texproj.project import Project

MOST = 24
"""Points that are proposed at a time; nobody accepts more one by one."""

SURE = 3.0
"""A point is sought within so many standard deviations of its place."""

SAME = 5e-3
"""Picks nearer to each other than this part of the model's diagonal are one point."""

ON_SURFACE = 2e-3
"""A ray that ends within this part of the model's diagonal of a point sees the point."""


@dataclass(frozen=True, eq=False)
class Guess:
    """The camera of a full-size photo, and how far off it may put a point, pixels."""

    camera: Camera
    within_px: float


@dataclass(frozen=True, eq=False)
class Elsewhere:
    """A point picked in another photo. xyz: (3,) float64 world."""

    photo: str
    name: str
    xyz: NDArray[np.float64]


def proposals(
    project: Project, surface: Surface, photo: Photo, guess: Guess, own: NDArray[np.float64]
) -> list[dict[str, Any]]:
    """Where points of other photos should lie in `photo`, moved to where model and photo agree
    best; first those that are farthest from what is picked already.

    own: (n, 3) points picked in it.
    """
    camera = guess.camera
    diagonal = float(np.linalg.norm(np.ptp(surface.mesh.vertices, axis=0)))
    taken = list(own)
    seen: list[Elsewhere] = []
    for point in _elsewhere(project, photo.info.name):
        near = any(np.linalg.norm(point.xyz - other) < SAME * diagonal for other in taken)
        if not near and _sees(surface, camera, point.xyz, ON_SURFACE * diagonal):
            taken.append(point.xyz)
            seen.append(point)
    found = []
    for point in _spread(seen, camera, own)[:MOST]:
        there = predict_on_photo(surface, photo, camera, point.xyz, guess.within_px)
        if there is not None:
            found.append({"photo": point.photo, "name": point.name, **there.as_dict()})
    return found


def _elsewhere(project: Project, name: str) -> Iterator[Elsewhere]:
    """The picks of all other photos; files that cannot be read are told of in the photo list."""
    for other in project.photo_names:
        if other == name:
            continue
        try:
            if leaves(project.correspondences_path(other), project.root):
                continue
            picks = project.load_correspondences(other)
        except TexprojError:
            continue
        if picks is not None:
            for label, xyz in zip(picks.names, picks.xyz_in_world, strict=True):
                yield Elsewhere(other, label, xyz)


def _sees(surface: Surface, camera: Camera, xyz: NDArray[np.float64], within: float) -> bool:
    """Whether a camera sees the front of the surface at a point."""
    xy_px, depth = camera.project(xyz[None])
    if not (depth[0] > 0 and np.isfinite(xy_px).all() and camera.inside(xy_px[0])):
        return False
    center = camera.pose.center
    direction = (xyz - center) / np.linalg.norm(xyz - center)
    hit = surface.hit(center, direction)
    return hit is not None and not hit.back and bool(np.linalg.norm(hit.xyz - xyz) <= within)


def _spread(points: list[Elsewhere], camera: Camera, own: NDArray[np.float64]) -> list[Elsewhere]:
    """The points, each next one the farthest in the picture from all before it and from `own`."""
    if not points:
        return []
    at = camera.project(np.array([p.xyz for p in points]))[0]
    before = camera.project(own)[0] if len(own) else at[:1]
    gap = np.linalg.norm(at[:, None] - before[None], axis=2).min(axis=1)
    order: list[Elsewhere] = []
    for _ in range(min(MOST, len(points))):
        k = int(np.nanargmax(gap))
        order.append(points[k])
        gap = np.fmin(gap, np.linalg.norm(at - at[k], axis=1))
        gap[k] = -1
    return order
