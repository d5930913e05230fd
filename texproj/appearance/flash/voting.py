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
VOTERS = 40
SURE = 0.65
"""Part of the points, those of the largest margin, that vote."""

PLACE = 0.03
"""Of the diagonal, and
"""
CHROMA = 0.15
"""difference in log chroma, that make points equally far from each other."""

VOTE, POTTS = 1.0, 0.1
"""What the vote and what neighbors count for, against the mean of log (1 + squared deviation)."""

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


def smoothed(cost: Floats, known: Bools, neighbors: Any) -> Floats:
    """(n, k) costs averaged with those of their neighbors; points that are not known take all of
    them from there.
    """
    weight = known.astype(np.float32)[:, None]
    out = cost * weight
    for _ in range(SMOOTHINGS):
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
class Voters:
    """Points that are sure of their material. tree: of place and chroma; label: (n,)."""

    tree: cKDTree
    label: Index
    materials: int
    diagonal: float

    @classmethod
    def of(cls, xyz: Floats, rgb: Floats, cost: Floats, known: Bools, diagonal: float) -> Voters:
        """The surest of n points of costs (n, k) and colors rgb (n, 3)."""
        sure = margin(cost)
        limit = np.quantile(sure[known], 1 - SURE) if known.any() else 0
        rows = np.flatnonzero(known & (sure >= limit))
        tree = cKDTree(_features(xyz[rows], rgb[rows], diagonal))
        return cls(tree, np.argmin(cost[rows], axis=1), cost.shape[1], diagonal)

    def shares(self, xyz: Floats, rgb: Floats) -> Floats:
        """(n, k) part of the votes for each material, none without any."""
        count = min(VOTERS, self.tree.n)
        near = self.tree.query(_features(xyz, rgb, self.diagonal), count, workers=-1)[1]
        votes = self.label[near.reshape(len(xyz), count)]
        out = [(votes == k).mean(axis=1) for k in range(self.materials)]
        shares = np.stack(out, axis=1) * count + 0.5
        return (shares / shares.sum(axis=1, keepdims=True)).astype(np.float32)


def _features(xyz: Floats, rgb: Floats, diagonal: float) -> Doubles:
    return np.column_stack([xyz / (PLACE * diagonal), log_chroma(rgb) / CHROMA])


def settled(cost: Floats, shares: Floats, neighbors: Any) -> tuple[Index, Floats]:
    """(n,) labels of least cost with votes and neighbors, and (n,) how sure they are, 0..1.

    Iterated conditional modes (Besag 1986), all points at once and by halves in turn.
    """
    unary = cost - VOTE * np.log(shares)
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
