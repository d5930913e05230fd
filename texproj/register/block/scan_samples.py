"""The mesh as points with normals, in a frame in which its size is 1, for placing a block on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from texproj.arrays import Bools, Doubles, Floats
from texproj.mesh import Mesh, face_cross, norms
from texproj.register.block.similarity import Similarity
from texproj.register.block.subject import in_relief

SAMPLES = 40_000
NEIGHBORS = 24
"""Normals are averaged over so many samples: scans are noisy."""
RIM = 0.02
"""Samples closer to the mesh's border than this part of its size are no partners: what lies
beyond the border would be drawn to it."""
MOST_RIM = 0.5
"""A larger share of samples at borders means that the mesh is in pieces; then there is no rim."""
LOOKUP_CELLS = 96
"""Cells along the longest side of the table of nearest samples."""
LOOKUP_MARGIN, LOOKUP_REACH = 0.3, 4.0
"""How far it goes beyond the mesh, and from its middle."""
LEAST_RELIEF, MOST_RELIEF = 0.02, 0.6
"""Share of the surface, and size relative to the mesh, between which the relief is a scene of its
own ..."""
AROUND_RELIEF = 3.0
"""... that reaches so far, in its own sizes."""
MEDIAN_ROUNDS = 30
FACES_AT_ONCE = 1 << 19
"""Bounds the memory for large meshes."""


@dataclass(frozen=True, eq=False)
class NearestTable:
    """Which sample is nearest, looked up by cell. low: (3,) corner; index: (x, y, z) int32."""

    low: Floats
    cell: float
    index: NDArray[np.int32]

    def __call__(self, xyz: Floats) -> tuple[NDArray[np.int32], Bools]:
        """Numbers of samples near (..., 3) points, and whether the points are in the table."""
        where = np.floor((xyz - self.low) / np.float32(self.cell)).astype(np.int32)
        limit = np.array(self.index.shape, np.int32) - 1
        inside = ((where >= 0) & (where <= limit)).all(axis=-1)
        where = np.clip(where, 0, limit)
        flat = (where[..., 0] * self.index.shape[1] + where[..., 1]) * self.index.shape[2]
        return self.index.ravel()[flat + where[..., 2]], inside


@dataclass(frozen=True, eq=False)
class ScanSamples:
    """world_from_unit: from the frame in which the mesh has size 1 about the origin.

    xyz, normal: (n, 3) float32 in that frame; partner: (n,) False at the mesh's border.
    """

    world_from_unit: Similarity
    xyz: Floats
    normal: Floats
    partner: Bools

    @classmethod
    def of(cls, mesh: Mesh, seed: int = 0) -> ScanSamples:
        """Points spread evenly over the surface."""
        rng = np.random.default_rng(seed)
        xyz, normal = _spread(mesh, SAMPLES, rng)
        return cls._made(mesh, xyz, normal, *middle_and_size(xyz))

    @classmethod
    def of_relief(cls, mesh: Mesh, whole: ScanSamples, seed: int = 0) -> ScanSamples | None:
        """Points around what is neither floor nor wall, in the frame in which that has size 1;
        None where it is not much smaller than the `whole` mesh.
        """
        left = in_relief(whole.xyz, whole.normal, seed)
        if left.sum() < LEAST_RELIEF * len(left):
            return None
        middle, size = middle_and_size(whole.xyz[left].astype(np.float64))
        if size > MOST_RELIEF:
            return None
        middle, size = (
            whole.world_from_unit.apply(middle[None])[0],
            whole.world_from_unit.scale * size,
        )
        corners = mesh.vertices[mesh.faces[:, 0]]
        near = Mesh(mesh.vertices, mesh.faces[norms(corners - middle) < AROUND_RELIEF * size])
        xyz, normal = _spread(near, SAMPLES, np.random.default_rng(seed))
        return cls._made(mesh, xyz, normal, middle, size)

    @classmethod
    def _made(
        cls, mesh: Mesh, xyz: Doubles, normal: Doubles, middle: Doubles, size: float
    ) -> ScanSamples:
        unit = ((xyz - middle) / size).astype(np.float32)
        partner = ~_at_rim((_border(mesh) - middle) / size, unit)
        if partner.mean() < 1 - MOST_RIM:
            partner[:] = True
        return cls(Similarity(size, np.eye(3), middle), unit, _smoothed(unit, normal), partner)

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.xyz)

    @cached_property
    def table(self) -> NearestTable:
        """The nearest samples, all over the mesh and a little around it."""
        low = np.maximum(self.xyz.min(axis=0) - LOOKUP_MARGIN, -LOOKUP_REACH)
        span = np.minimum(self.xyz.max(axis=0) + LOOKUP_MARGIN, LOOKUP_REACH) - low
        cell = float(span.max() / LOOKUP_CELLS)
        shape = tuple(int(n) for n in np.ceil(span / cell).astype(int))
        where = np.floor((self.xyz - low) / cell).astype(int)
        inside = ((where >= 0) & (where < shape)).all(axis=1)
        sample = np.full(shape, -1, np.int32)
        sample[tuple(where[inside].T)] = np.flatnonzero(inside)
        nearest = ndimage.distance_transform_edt(
            sample < 0, return_distances=False, return_indices=True
        )
        return NearestTable(low, cell, np.ascontiguousarray(sample[tuple(nearest)]))


def middle_and_size(xyz: Doubles) -> tuple[Doubles, float]:
    """The geometric median (3,) of points (Weiszfeld 1937), and the radius that holds 80 %."""
    middle = np.median(xyz, axis=0)
    for _ in range(MEDIAN_ROUNDS):
        distance = norms(xyz - middle)
        weight = 1 / np.maximum(distance, 1e-9 + 1e-3 * distance.mean())
        middle = (xyz * weight[:, None]).sum(axis=0) / weight.sum()
    return middle, float(np.quantile(norms(xyz - middle), 0.8))


def _spread(mesh: Mesh, count: int, rng: np.random.Generator) -> tuple[Doubles, Doubles]:
    """(count, 3) points spread by area, stratified, and the unit normals of their faces."""
    parts = range(0, len(mesh.faces), FACES_AT_ONCE)
    area = np.concatenate(
        [norms(face_cross(mesh.vertices, mesh.faces[k : k + FACES_AT_ONCE])) for k in parts]
    )
    total = np.cumsum(area)
    at = (np.arange(count) + rng.random(count)) / count * total[-1]
    face = np.minimum(np.searchsorted(total, at), len(area) - 1)
    u, v = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1 - u, u * (1 - v), u * v], axis=1)
    chosen = mesh.faces[face]
    xyz = np.einsum("ni,nij->nj", weights, mesh.vertices[chosen])
    cross = face_cross(mesh.vertices, chosen)
    return xyz, cross / np.maximum(area[face], 1e-300)[:, None]


def _smoothed(xyz: Floats, normal: Doubles) -> Floats:
    """Normals averaged over those of neighbors that face the same way."""
    count = min(NEIGHBORS, len(xyz))
    near = normal[cKDTree(xyz).query(xyz, count)[1]].astype(np.float32)
    same = np.einsum("nkj,nj->nk", near, normal.astype(np.float32)) > 0
    mean = np.einsum("nkj,nk->nj", near, same.astype(np.float32))
    return mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-12)[:, None].astype(np.float32)


def _border(mesh: Mesh) -> Doubles:
    """(n, 3) middles of the edges that belong to one face only."""
    count = len(mesh.vertices)
    edges = np.empty((3, len(mesh.faces)), np.int64)
    for k in range(3):
        a, b = mesh.faces[:, k], mesh.faces[:, (k + 1) % 3]
        edges[k] = np.minimum(a, b) * np.int64(count) + np.maximum(a, b)
    ranked = edges.ravel()
    ranked.sort()
    differs = ranked[1:] != ranked[:-1]
    lonely = np.append(True, differs) & np.append(differs, True)
    return mesh.vertices[np.stack(np.divmod(ranked[lonely], count))].mean(axis=0)


def _at_rim(border: Doubles, xyz: Floats) -> Bools:
    if not len(border):
        return np.zeros(len(xyz), bool)
    return np.isfinite(cKDTree(border).query(xyz, distance_upper_bound=RIM)[0])
