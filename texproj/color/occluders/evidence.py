"""Where the photos contradict and confirm each other on the surface."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.balance.focus import median_of_others
from texproj.color.balance.photometry import Photometry
from texproj.color.balance.shared_points import SharedPoints
from texproj.color.points.source import CHUNK, Chunk, Owners
from texproj.mesh import Mesh, face_areas

WITNESSES = 2
"""Other photos that must show a point: of two photos that differ, nobody knows which is wrong."""

SPREAD = 0.05
"""Square roots of linear light by which the other photos may differ (median) to be a witness."""

DIFFERENT = 0.14
"""Difference, in square roots of linear light, that contradicts: what is left of exposures and
registration is .02 to .05 in real photos, another thing in front is .2 to .6 away."""

ALIKE = 0.08
"""Difference that confirms."""

DARK = 0.03
"""Square root of linear light below which ratios are noise."""

USUAL = 4.0
"""A contradiction is so many times what the photo differs by usually (median), at least."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Random points, evenly over the surface, in chunks.

    owners: the faces; xyz: (n, 3) float32 relative to their origin; face: (n,) int32.
    """

    owners: Owners
    xyz: Floats
    face: NDArray[np.int32]

    @classmethod
    def of(cls, mesh: Mesh, spacing: float, count: int) -> SurfacePoints:
        """spacing: edge of the square that a point is read over, mesh units."""
        rng, area = np.random.default_rng(1), face_areas(mesh)
        face = np.sort(rng.choice(len(area), count, p=area / area.sum())).astype(np.int32)
        corners = (mesh.vertices - mesh.center)[mesh.faces[face]]
        xyz = np.einsum("nk,nkc->nc", rng.dirichlet((1, 1, 1), count), corners)
        owners = Owners.of_faces(mesh, np.full(len(area), spacing))
        return cls(owners, xyz.astype(np.float32), face)

    @property
    def sizes(self) -> list[int]:
        return [min(CHUNK, len(self.face) - start) for start in range(0, len(self.face), CHUNK)]

    def chunk(self, number: int) -> Chunk:
        rows = slice(number * CHUNK, number * CHUNK + self.sizes[number])
        return Chunk(self.xyz[rows], self.face[rows])


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the other photos say of m observations, in the order of `SharedPoints`.

    against, for_: (m,) bool, whether they contradict, confirm; neither where too few can tell;
    ratio: (m, 3) log of the photo's light over theirs, 0 where nobody can tell;
    start: (p + 1,) the first observation of each photo.
    """

    against: NDArray[np.bool_]
    for_: NDArray[np.bool_]
    ratio: Floats
    start: NDArray[np.intp]

    def rows(self, photo: int) -> slice:
        """The observations of a photo."""
        return slice(int(self.start[photo]), int(self.start[photo + 1]))


def evidence(shared: SharedPoints, light: Photometry) -> Evidence:
    """Compare each observation with the median of the others of the same point."""
    start = np.searchsorted(shared.photo, np.arange(len(shared.shots) + 1))
    root = np.sqrt(even_light(shared, light, start))
    count = len(shared.point)
    apart, spread = np.zeros(count), np.zeros(count)
    witnesses = np.zeros(count, np.intp)
    ratio = np.zeros((count, 3), np.float32)
    for channel, logs in zip(root.T, ratio.T, strict=True):
        median, witnesses = median_of_others(channel, shared.point)
        logs[:] = 2 * np.log(np.maximum(channel, DARK) / np.maximum(median, DARK))
        difference = np.abs(channel - median)
        apart += np.nan_to_num(difference) ** 2
        spread += np.nan_to_num(median_of_others(difference, shared.point)[0]) ** 2
    told = (witnesses >= WITNESSES) & (spread < SPREAD**2)
    apart = np.sqrt(apart)
    usual = np.zeros(count)
    for rows in (slice(a, b) for a, b in pairwise(start)):
        usual[rows] = np.median(apart[rows][told[rows]]) if told[rows].any() else 0
    different = apart > np.maximum(DIFFERENT, USUAL * usual)
    ratio = np.nan_to_num(ratio)
    return Evidence(told & different, told & (apart < ALIKE) & ~different, ratio, start)


def even_light(shared: SharedPoints, light: Photometry, start: NDArray[np.intp]) -> Floats:
    """(m, 3) linear light as it would be if all photos had the same exposure, without
    vignetting. start: (p + 1,) the first observation of each photo.
    """
    rgb = shared.rgb.copy()
    for number, shot in enumerate(shared.shots):
        mine = slice(start[number], start[number + 1])
        fix = light.corrections[number]
        rgb[mine] *= fix.gain
        if shot is None or fix.light is None:
            continue
        height, width = fix.light.shape
        at = shared.xy_px[mine] * (width / shot.camera.width, height / shot.camera.height)
        column, row = at.astype(int).T
        rgb[mine] *= fix.light[row.clip(0, height - 1), column.clip(0, width - 1)][:, None]
    return rgb
