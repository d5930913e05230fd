"""Which material each point is: by what fits, by points alike nearby, by its neighbors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.spatial import cKDTree

from texproj.appearance.palette import log_chroma
from texproj.arrays import Bools, Doubles, Floats, Index

SMOOTHINGS = 2
"""Of points by which materials are chosen: single ones are noisy. Labels come by votes instead,
since averages take away what is at borders.
"""

VOTERS = 15
"""More take small parts away: 100 lose every sixth point of metal, 15 every twentieth."""

SURE = 0.65
"""Part of the points, those of the largest margin, that vote."""

PLACE, CHROMA = 0.03, 0.08
"""Part of the diagonal, and difference in log chroma, that make points equally far."""

FAR_PLACE, FAR_VOTERS, CLEAR = 1.0, 40, 0.4
"""Of the other party: a paint is of one material all over the piece, and most of its points saw no
highlight; costs that differ by `CLEAR` tell.
"""

POTTS = 0.1
"""What neighbors count for, against the mean of log (1 + squared deviation)."""

ROUNDS = 6
NEAR = 6
"""Neighbors of points that have no mesh between them."""


def mesh_neighbors(faces: Any, count: int) -> Any:
    """(V, V) sparse mean over the neighbors along the edges of a mesh."""
    a, b = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    return _mean(np.concatenate([a, b]), np.concatenate([b, a]), count)


def near_neighbors(xyz: Floats, normal: Floats) -> Any:
    """(n, n) sparse mean over the nearest points that face the same way."""
    near = cKDTree(xyz).query(xyz, min(NEAR + 1, len(xyz)), workers=-1)[1][:, 1:]
    one = np.repeat(np.arange(len(xyz)), near.shape[1])
    alike = np.einsum("ij,ij->i", normal[one], normal[near.ravel()]) > 0.5
    return _mean(one[alike], near.ravel()[alike], len(xyz))


def _mean(one: Index, other: Index, count: int) -> Any:
    sums = csr_array(coo_array((np.ones(len(one), np.float32), (one, other)), (count, count)))
    sums.data[:] = 1
    total = np.asarray(sums.sum(axis=1)).ravel()
    return (diags_array((1 / np.maximum(total, 1)).astype(np.float32)) @ sums).tocsr()


def smoothed(cost: Floats, known: Bools, neighbors: Any, times: int = SMOOTHINGS) -> Floats:
    """(n, k) costs averaged with those of their neighbors; points that are not known take all of
    them from there.
    """
    weight = known.astype(np.float32)[:, None]
    out = cost * weight
    for _ in range(times):
        out = out + neighbors @ out
        weight = weight + neighbors @ weight
        out, weight = out / 2, weight / 2
    return np.divide(out, np.maximum(weight, 1e-6), dtype=np.float32)


def margin(cost: Floats) -> Floats:
    """(n,) how much worse the second best column is, 0..1; 1 where there is but one."""
    if cost.shape[1] == 1:
        return np.ones(len(cost), np.float32)
    two = np.partition(cost, 1, axis=1)[:, :2]
    return (1 - two[:, 0] / np.maximum(two[:, 1], np.float32(1e-6))).astype(np.float32)


@dataclass(frozen=True, eq=False)
class _Party:
    """Points that vote. tree: of place and chroma; weight: (n, k) of each for each material."""

    tree: cKDTree
    weight: Floats
    place: float

    @classmethod
    def of(cls, xyz: Floats, rgb: Floats, weight: Floats, place: float) -> _Party:
        return cls(cKDTree(place_and_chroma(xyz, rgb, place)), weight, place)

    def shares(self, xyz: Floats, rgb: Floats, count: int) -> Floats:
        """(n, k) part of the votes of the nearest, half a usual one more for each material."""
        if not self.tree.n:
            return np.ones((len(xyz), self.weight.shape[1]), np.float32)
        count = min(count, self.tree.n)
        near = self.tree.query(place_and_chroma(xyz, rgb, self.place), count, workers=-1)[1]
        votes = self.weight[near.reshape(len(xyz), count)].sum(axis=1)
        votes = votes + np.float32(0.5 * self.weight.sum(axis=1).mean())
        shares: Floats = votes / votes.sum(axis=1, keepdims=True)
        return shares


@dataclass(frozen=True, eq=False)
class Voters:
    """Points that are sure of their material. near: those near in place and chroma; alike: those of
    like chroma anywhere that saw what parts the materials, by how clearly.
    """

    near: _Party
    alike: _Party

    @classmethod
    def of(cls, xyz: Floats, rgb: Floats, cost: Floats, known: Bools, diagonal: float) -> Voters:
        """The surest of n points of costs (n, k) and colors rgb (n, 3)."""
        sure = margin(cost)
        limit = np.quantile(sure[known], 1 - SURE) if known.any() else 0
        best = np.eye(cost.shape[1], dtype=np.float32)[np.argmin(cost, axis=1)]
        gap = _gap(cost)
        parties = []
        for rows, weight, place in (
            (known & (sure >= limit), best, PLACE),
            (known & (gap > CLEAR), best * np.minimum(gap, 1)[:, None], FAR_PLACE),
        ):
            parties.append(_Party.of(xyz[rows], rgb[rows], weight[rows], place * diagonal))
        return cls(*parties)

    def votes(self, xyz: Floats, rgb: Floats) -> Floats:
        """(n, k) log of the parts of the votes, of both parties."""
        near = self.near.shares(xyz, rgb, VOTERS)
        alike = self.alike.shares(xyz, rgb, FAR_VOTERS)
        return np.log(near) + np.log(alike)


def _gap(cost: Floats) -> Floats:
    """(n,) how much larger the second lowest cost is; 0 where there is but one."""
    if cost.shape[1] == 1:
        return np.zeros(len(cost), np.float32)
    two = np.partition(cost, 1, axis=1)[:, :2]
    gap: Floats = two[:, 1] - two[:, 0]
    return gap


def place_and_chroma(xyz: Floats, rgb: Floats, place: float) -> Doubles:
    """(n, 5) in which points alike and near are near; place: distance that counts as 1."""
    return np.column_stack([xyz / place, log_chroma(rgb) / CHROMA])


def settled(cost: Floats, votes: Floats, neighbors: Any) -> tuple[Index, Floats]:
    """(n,) labels of least cost with votes and neighbors, and (n,) how sure they are, 0..1.

    Iterated conditional modes (Besag 1986), all points at once and by halves in turn.
    """
    unary = cost - votes
    label = np.argmin(unary, axis=1)
    half = np.arange(len(label)) % 2
    total = unary
    for turn in range(2 * ROUNDS if cost.shape[1] > 1 else 0):
        one = np.eye(cost.shape[1], dtype=np.float32)[label]
        total = unary - POTTS * 6 * (neighbors @ one)
        label = np.where(half == turn % 2, np.argmin(total, axis=1), label)
    odds = np.exp(total.min(axis=1, keepdims=True) - total)
    sure = 1 / odds.sum(axis=1)
    return label, ((sure - 1 / odds.shape[1]) / max(1 - 1 / odds.shape[1], 1e-6)).clip(0, 1)
