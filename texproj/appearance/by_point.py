"""What photos say of points, ordered by point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from texproj.arrays import Floats, Index


@dataclass(frozen=True, eq=False)
class ByPoint:
    """m rows about `count` points. point: (m,) numbers, ascending."""

    count: int
    point: Index

    @cached_property
    def _summing(self) -> Any:
        ends = np.searchsorted(self.point, np.arange(self.count + 1))
        ones = np.ones(len(self.point), np.float32)
        shape = (self.count, len(self.point))
        return csr_array((ones, np.arange(len(ones)), ends), shape=shape)

    def sums(self, values: Any) -> Floats:
        """(count, k) sums over each point's rows of (m, k) values."""
        out: Floats = self._summing @ values
        return out

    @cached_property
    def number(self) -> Index:
        """(count,) rows of each point."""
        return np.bincount(self.point, minlength=self.count)
