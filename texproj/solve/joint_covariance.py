"""Covariance of many cameras solved together, of which only few numbers are ever computed.

The inverse of a sparse matrix is dense: of a thousand cameras 36 million numbers. Wanted are those
where the matrix itself has any, and they follow from its factors alone, from the last column to
the first (Takahashi, Fagan and Chin 1973), front by front (Duff and Reid 1983).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse.linalg import splu

from texproj.arrays import Doubles, Index
from texproj.solve.lm import LmFit

SINGULAR = 1e14
"""Largest variance, over the number of parameters, in units in which each alone would have 1."""


@dataclass(frozen=True, eq=False)
class JointCovariance:
    """Covariance of the step of a joint problem: six numbers a camera, then those of the lenses.

    scaled: (p, p) the sparse inverse of it with ones on the diagonal; scale: (p,); blocks: of the
    inverse of `scaled`, one node a camera and one a number of the lenses.
    """

    scaled: Any
    scale: Doubles
    cameras: int
    blocks: InverseBlocks

    @classmethod
    def of(cls, fit: LmFit[Any], scatter2: float, cameras: int) -> JointCovariance | None:
        """Of the fit with this variance factor; None where the data say nothing of some number, or
        nothing that can be computed.
        """
        hessian = sparse.csr_array(fit.data_hessian / max(scatter2, 1e-300) + fit.prior_hessian)
        scale = np.sqrt(np.maximum(hessian.diagonal(), 1e-300))
        down = sparse.diags_array(1 / scale)
        scaled = sparse.csr_array(down @ hessian @ down)
        lenses = len(scale) - 6 * cameras
        node = np.concatenate([np.repeat(np.arange(cameras), 6), cameras + np.arange(lenses)])
        try:
            blocks = InverseBlocks.of(scaled, node)
        except np.linalg.LinAlgError:
            return None
        if not blocks.largest <= SINGULAR / len(scale):
            return None
        return cls(scaled, scale, cameras, blocks)

    def times(self, columns: Doubles) -> Doubles:
        """(p, k) the covariance times (p, k)."""
        solved: Doubles = self._factor.solve(columns / self.scale[:, None])
        return solved / self.scale[:, None]

    def of_camera(self, k: int, lens: Index) -> Doubles:
        """(6 + m, 6 + m) of the six numbers of camera k and those numbered `lens` (m,) of the
        lenses, which are its own.
        """
        scale = self.scale[np.concatenate([6 * k + np.arange(6), 6 * self.cameras + lens])]
        return self.blocks.among([k, *(self.cameras + lens).tolist()]) / np.outer(scale, scale)

    @cached_property
    def _factor(self) -> Any:
        return splu(sparse.csc_matrix(self.scaled), permc_spec="MMD_AT_PLUS_A")


@dataclass(frozen=True, eq=False)
class InverseBlocks:
    """Blocks of the inverse of a sparse symmetric positive definite matrix, its columns grouped in
    nodes. fronts: of each node the inverse among itself and the nodes after it that it hangs
    together with, and the columns of each of these in it; position: of each node in the order of
    elimination; width: columns of each node.
    """

    fronts: dict[int, tuple[dict[int, slice], Doubles]]
    position: Index
    width: Index

    @classmethod
    def of(cls, matrix: Any, node: Index) -> InverseBlocks:
        """matrix: (p, p) csr; node: (p,) of each column, ascending from 0, each in use. Raises
        LinAlgError where it is not positive definite.
        """
        starts = np.searchsorted(node, np.arange(int(node[-1]) + 2))
        position, later = _eliminated(matrix, node)
        factors = _factors(matrix, starts, position, later)
        fronts: dict[int, tuple[dict[int, slice], Doubles]] = {}
        for j in np.argsort(position)[::-1].tolist():
            own, pivot, coupling = factors[j]
            places = _places([j, *own], np.diff(starts))
            inverse = cho_solve(pivot, np.eye(len(pivot[0])))
            if own:
                above, whole = fronts[own[0]]
                rows = np.concatenate([np.arange(above[k].start, above[k].stop) for k in own])
                rest = whole[np.ix_(rows, rows)]
                across = -coupling @ rest
                inverse = np.block([[inverse - across @ coupling.T, across], [across.T, rest]])
            fronts[j] = places, inverse
        return cls(fronts, position, np.diff(starts))

    @property
    def largest(self) -> float:
        """The largest number on the diagonal."""
        return max(float(np.diag(front).max()) for _, front in self.fronts.values())

    def among(self, nodes: Sequence[int]) -> Doubles:
        """The inverse among some nodes; zero between two that do not hang together."""
        places = _places(nodes, self.width)
        out = np.zeros((sum(self.width[k] for k in nodes),) * 2)
        for one in nodes:
            for two in nodes:
                first, second = sorted((one, two), key=lambda k: self.position[k])
                there, front = self.fronts[first]
                if second in there:
                    block = front[there[first], there[second]]
                    out[places[one], places[two]] = block if one == first else block.T
        return out


def _eliminated(matrix: Any, node: Index) -> tuple[Index, list[list[int]]]:
    """(n,) the position of each node in an order that leaves few blocks (minimum degree), and the
    nodes after each, in that order, that its elimination ties together.
    """
    entries = matrix.tocoo()
    count = int(node[-1]) + 1
    one, two = node[entries.row], node[entries.col]
    graph = sparse.coo_array((np.ones(len(one)), (one, two)), shape=(count, count)).tocsc()
    graph.data[:] = 1.0
    ordered = splu(sparse.csc_matrix(graph + count * sparse.eye_array(count)), "MMD_AT_PLUS_A")
    position = np.asarray(ordered.perm_c, np.intp)
    later: list[set[int]] = [set() for _ in range(count)]
    for i, j in zip(*graph.nonzero(), strict=True):
        if position[j] > position[i]:
            later[i].add(int(j))
    ordered_later: list[list[int]] = [[] for _ in range(count)]
    for j in np.argsort(position).tolist():
        ordered_later[j] = sorted(later[j], key=lambda k: position[k])
        if ordered_later[j]:
            later[ordered_later[j][0]].update(ordered_later[j][1:])
    return position, ordered_later


def _factors(
    matrix: Any, starts: Index, position: Index, later: list[list[int]]
) -> list[tuple[list[int], Any, Doubles]]:
    """Of each node the ones after it, the Cholesky factor of its own block once those before it are
    eliminated, and its inverse times the block beside it.
    """
    width = np.diff(starts)
    waiting: dict[int, list[tuple[list[int], Doubles]]] = {}
    out: list[Any] = [None] * len(later)
    for j in np.argsort(position).tolist():
        own = later[j]
        columns = np.concatenate([np.arange(starts[k], starts[k + 1]) for k in (j, *own)])
        front = np.zeros((len(columns), len(columns)))
        w = width[j]
        front[:w] = matrix[starts[j] : starts[j + 1]].toarray()[:, columns]
        front[w:, :w] = front[:w, w:].T
        places = _places([j, *own], width)
        for nodes, update in waiting.pop(j, ()):
            rows = np.concatenate([np.arange(places[k].start, places[k].stop) for k in nodes])
            front[np.ix_(rows, rows)] += update
        pivot = cho_factor(front[:w, :w], lower=True)
        coupling = cho_solve(pivot, front[:w, w:])
        out[j] = own, pivot, coupling
        if own:
            waiting.setdefault(own[0], []).append((own, front[w:, w:] - front[w:, :w] @ coupling))
    return out


def _places(nodes: Sequence[int], width: Index) -> dict[int, slice]:
    """Where the columns of each node are, one node after the other."""
    ends = np.cumsum(width[list(nodes)]).tolist()
    return {k: slice(end - int(width[k]), end) for k, end in zip(nodes, ends, strict=True)}
