"""In which order photos are tried through others: best evidence first, until nothing changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import NamedTuple

Evidence = frozenset[tuple[str, str]]
"""Registered photos through which one could be found, each with the hash of its camera."""


class _Place(NamedTuple):
    """The smallest comes first."""

    attempts: int
    waits: bool
    less: int
    rank: int


@dataclass
class Wave:
    """The photos that are still to be found, and what each was tried with.

    evidence: through what a photo could be found now; strength: how much it shares with that;
    waits: whether it was found before through a photo that is still to be found.
    """

    evidence: Callable[[str], Evidence]
    strength: Callable[[str], int]
    waits: Callable[[str], bool]
    _tried: dict[str, Evidence | None] = field(default_factory=dict)
    _rank: dict[str, int] = field(default_factory=dict)
    _attempts: dict[str, int] = field(default_factory=dict)
    _places: dict[str, _Place] = field(default_factory=dict)
    _queue: list[tuple[_Place, str]] = field(default_factory=list)

    def add(self, name: str, tried: Evidence | None = None) -> None:
        """One more photo to be found; tried: with what that has failed before, if it has."""
        self._tried[name] = tried
        self._rank[name] = len(self._rank)

    def look(self, names: Iterable[str]) -> None:
        """See which of the photos `names` have new evidence; a photo that has none is tried once
        all the same.
        """
        for name in names:
            if name not in self._tried:
                continue
            before = self._tried[name]
            if before is not None and self.evidence(name) <= before:
                continue
            attempts = self._attempts.get(name, 0)
            strength = self.strength(name)
            place = _Place(attempts, self.waits(name), -strength, self._rank[name])
            if place != self._places.get(name):
                self._places[name] = place
                heappush(self._queue, (place, name))

    def next(self) -> str | None:
        """The photo to be tried now; None when none has new evidence."""
        while self._queue:
            place, name = heappop(self._queue)
            if self._places.get(name) == place:
                del self._places[name]
                self._tried[name] = (self._tried[name] or frozenset()) | self.evidence(name)
                self._attempts[name] = place.attempts + 1
                return name
        return None

    def drop(self, name: str) -> None:
        """The photo needs not be tried any more."""
        del self._tried[name]

    @property
    def left(self) -> list[str]:
        """The photos that were not found."""
        return list(self._tried)
