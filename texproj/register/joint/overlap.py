"""Which photos see the same surface, and from how far apart: whom to compare with whom."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera
from texproj.render import GBuffer, Render

SIGHT_PX = 256
"""Longer side of the depth images that decide what a photo sees."""
DEPTH_TOLERANCE = 0.02
"""A point is seen if it is at most this part of its depth behind the depth image; the images are
coarse, and a wrong guess costs a pair that matching then finds empty."""
SAMPLES_PER_PHOTO, SAMPLES = 400, 24_000
"""Surface points of a photo that all others are asked for, and of all photos together: beyond sixty
photos each asks for fewer, and the time grows with the photos, not with their square."""
LEAST_SAMPLES = 32
"""A share of a fifth is then known within .07."""
LEAST_SHARED = 0.2
"""Photos that share less than this part of what either sees are not compared (Dellepiane et al.
2013 use the same)."""
WIDEST_DEG = 50.0
"""Beyond this angle between the lines of sight patches no longer look alike."""


def sees(camera: Camera, depth: NDArray[np.float32], xyz_in_world: Doubles) -> NDArray[np.bool_]:
    """(n,) whether points are in the picture and not behind what `depth` shows."""
    h, w = depth.shape
    small = camera.resized(w, h)
    xy, z = small.project(xyz_in_world)
    inside = small.inside(xy)
    column, row = np.where(inside[:, None], xy, 0).astype(int).T
    out: NDArray[np.bool_] = inside & (z <= depth[row, column] * (1 + DEPTH_TOLERANCE))
    return out


def shared_views(cameras: Sequence[Camera], render: Render) -> tuple[Doubles, Doubles]:
    """((n, n) share of what photo i sees that photo j sees too, (n, n) mean angle in degrees
    between their lines of sight there).
    """
    each = samples_each(len(cameras))
    return shares_of(cameras, [Glimpse.of(camera, render, each) for camera in cameras])


def samples_each(photos: int) -> int:
    """Surface points that each of so many photos is asked for."""
    return min(SAMPLES_PER_PHOTO, max(LEAST_SAMPLES, SAMPLES // max(photos, 1)))


def shares_of(cameras: Sequence[Camera], glimpses: Sequence[Glimpse]) -> tuple[Doubles, Doubles]:
    """As `shared_views`, by what each camera sees."""
    small = [camera.reduced(SIGHT_PX) for camera in cameras]
    size = np.array([len(one.xyz) for one in glimpses], np.intp)
    owner = np.repeat(np.arange(len(small)), size)
    xyz = np.concatenate([np.zeros((0, 3)), *(one.xyz for one in glimpses)])
    centers = np.array([camera.center for camera in small])
    share, angle_deg = np.zeros((len(small),) * 2), np.full((len(small),) * 2, 180.0)
    for j, other in enumerate(small):
        seen = np.flatnonzero(sees(other, glimpses[j].depth(), xyz) & (owner != j))
        count = np.bincount(owner[seen], minlength=len(small))
        share[:, j] = count / np.maximum(size, 1)
        angle = _angles_deg(xyz[seen], centers[owner[seen]], other.center)
        total = np.bincount(owner[seen], angle, len(small))
        angle_deg[count > 0, j] = total[count > 0] / count[count > 0]
    return share, angle_deg


@dataclass(frozen=True, eq=False)
class Glimpse:
    """What a camera sees, in small: its depth image in half of the memory, to a thousandth, and
    places on the surface. relative: (h, w) float16 of the farthest depth, infinite where there is
    no surface; xyz: (n, 3) world points spread over the picture.
    """

    relative: NDArray[np.float16]
    farthest: float
    xyz: Doubles

    @classmethod
    def of(cls, camera: Camera, render: Render, most: int) -> Glimpse:
        """camera: of any size; render: gives depth; most: places on the surface."""
        small = camera.reduced(SIGHT_PX)
        view = render(small)
        depth = view.require("depth")
        farthest = float(np.max(depth, where=np.isfinite(depth), initial=0)) or 1.0
        relative = (depth / np.float32(farthest)).astype(np.float16)
        return cls(relative, farthest, _surface_samples(small, view, most))

    def depth(self) -> Floats:
        """(h, w) depth, as it was rendered."""
        return self.relative.astype(np.float32) * np.float32(self.farthest)


def choose_partners(share: Doubles, angle_deg: Doubles, count: int) -> list[tuple[int, int]]:
    """Ordered pairs (i, j): for each photo i up to `count` others, from the closest line of sight
    to the widest that still shares enough.

    Wide pairs matter: a common slide of all photos along a facade shows only where their lines
    of sight differ.
    """
    pairs = []
    for i in range(len(share)):
        usable = (np.minimum(share[i], share[:, i]) >= LEAST_SHARED) & (angle_deg[i] < WIDEST_DEG)
        usable[i] = False
        candidates = np.flatnonzero(usable)
        candidates = candidates[np.argsort(angle_deg[i, candidates])]
        spread = np.linspace(0, len(candidates) - 1, min(count, len(candidates)))
        pairs += [(i, int(j)) for j in candidates[np.unique(spread.round().astype(int))]]
    return pairs


def _surface_samples(camera: Camera, images: GBuffer, most: int) -> Doubles:
    """(n, 3) world points spread over the picture, `most` of them or fewer."""
    row, column = np.nonzero(np.isfinite(images.require("depth")))
    keep = np.linspace(0, len(row) - 1, min(most, len(row))).astype(int)
    return images.points(camera, row[keep], column[keep])


def _angles_deg(xyz: Doubles, center: Doubles, other: Doubles) -> Doubles:
    """(n,) angle at each point between the lines to its own center (n, 3) and to another (3,)."""
    a, b = center - xyz, other - xyz
    cosine = (a * b).sum(1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    out: Doubles = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return out
