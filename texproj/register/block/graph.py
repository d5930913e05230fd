"""Which photos show the same, by what was matched between them (the correspondence graph of
Franken et al., "Minimizing user intervention in registering 2D images to 3D models", The Visual
Computer 2005, with features in place of clicks).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

LEAST_SHARED = 30
"""Matches below which a pair proves nothing: photos of two places had up to 20."""


@dataclass(frozen=True, eq=False)
class PhotoGraph:
    """Verified pairs of photos. matches: how many points both photos of a pair show, by the pair's
    two names in alphabetical order; compared: all photos that were looked at.
    """

    matches: Mapping[tuple[str, str], int]
    compared: frozenset[str] = frozenset()

    @cached_property
    def _neighbors(self) -> Mapping[str, tuple[tuple[int, str], ...]]:
        found: dict[str, list[tuple[int, str]]] = {}
        for (a, b), count in self.matches.items():
            if count < LEAST_SHARED:
                continue
            found.setdefault(a, []).append((-count, b))
            found.setdefault(b, []).append((-count, a))
        return {name: tuple(sorted(near)) for name, near in found.items()}

    def neighbors(self, name: str) -> tuple[str, ...]:
        """The photos that show the same as `name`, by LEAST_SHARED matches or more; most first."""
        return tuple(other for _, other in self._neighbors.get(name, ()))

    def joined(self, newer: PhotoGraph) -> PhotoGraph:
        """This graph, and a newer one in its place where both know a pair."""
        return PhotoGraph({**self.matches, **newer.matches}, self.compared | newer.compared)

    def count(self, a: str, b: str) -> int:
        """How many points were matched between two photos, and verified."""
        return self.matches.get((min(a, b), max(a, b)), 0)

    def knows(self, a: str, b: str) -> bool:
        """Whether two photos were looked at together, whatever came of it."""
        return {a, b} <= self.compared

    def stands_apart(self, name: str, others: Collection[str]) -> bool:
        """Whether a photo was compared with some of the others and shows hardly anything that one
        of them shows.
        """
        if name not in self.compared or any(other in others for other in self.neighbors(name)):
            return False
        return any(other in self.compared and other != name for other in others)
