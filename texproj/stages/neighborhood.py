"""Which registered photos are next to one: those that show the same, or stand beside it by name."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain

from texproj.records import CameraRecord
from texproj.stages.methods import MOST_COMPARED

IN_TURN = 8
"""Names before and after that of a photo which count as next to it: photos are taken in turn."""


class Neighborhood:
    """The photos in the order of their names, and which of those around one are registered.

    registered: their names; companions: by photo, the others that show the same, the best first.
    """

    def __init__(
        self,
        names: Sequence[str],
        registered: Collection[str],
        companions: Mapping[str, Sequence[str]],
    ) -> None:
        self._names = tuple(names)
        self._rank = {name: k for k, name in enumerate(names)}
        self.registered = {name for name in names if name in registered}
        self._ranks = sorted(self._rank[name] for name in self.registered)
        self.companions = companions

    @property
    def companions(self) -> Mapping[str, Sequence[str]]:
        return self._companions

    @companions.setter
    def companions(self, known: Mapping[str, Sequence[str]]) -> None:
        self._companions = known
        self._unknown = [name for name in self._names if name not in known]
        self._companion_of: dict[str, list[str]] = {}
        for name, others in known.items():
            for other in others:
                self._companion_of.setdefault(other, []).append(name)

    def around(self, name: str, apart: Callable[[str], bool]) -> tuple[str, ...]:
        """The registered photos that are next to `name`, without `name` and those `apart`: first
        those that show the same, then those whose names are next to it, however far away where it
        is not known who shows the same.
        """
        found: dict[str, None] = {}
        apart_by = IN_TURN if name in self._companions else len(self._names)
        by_name = self._outwards(self._rank[name], apart_by)
        for other in chain(self._showing_the_same(name), by_name):
            if other != name and not apart(other):
                found[other] = None
                if len(found) == MOST_COMPARED:
                    break
        return tuple(found)

    def reach(self, name: str) -> Iterator[str]:
        """The photos, or a few more, around which `name` may be."""
        yield from self._companion_of.get(name, ())
        rank = self._rank[name]
        yield from self._names[max(rank - IN_TURN, 0) : rank + IN_TURN + 1]
        yield from self._unknown

    def _showing_the_same(self, name: str) -> Iterator[str]:
        return (other for other in self._companions.get(name, ()) if self.has(other))

    def has(self, name: str) -> bool:
        """Whether a photo is registered."""
        return name in self.registered

    def add(self, name: str) -> None:
        """One more photo is registered."""
        if not self.has(name):
            self.registered.add(name)
            insort(self._ranks, self._rank[name])

    def remove(self, name: str) -> None:
        """A photo is registered no more."""
        if self.has(name):
            self.registered.remove(name)
            del self._ranks[bisect_left(self._ranks, self._rank[name])]

    def _outwards(self, rank: int, most: int) -> Iterator[str]:
        after = bisect_left(self._ranks, rank)
        before = after - 1
        while before >= 0 or after < len(self._ranks):
            below = rank - self._ranks[before] if before >= 0 else float("inf")
            above = self._ranks[after] - rank if after < len(self._ranks) else float("inf")
            if min(below, above) > most:
                return
            if below <= above:
                yield self._names[self._ranks[before]]
                before -= 1
            else:
                yield self._names[self._ranks[after]]
                after += 1


class Behind:
    """Which photos were found through which."""

    def __init__(self, records: Iterable[CameraRecord]) -> None:
        self._next: dict[str, set[str]] = {}
        self._through: dict[str, tuple[str, ...]] = {}
        for record in records:
            self.put(record)

    def put(self, record: CameraRecord) -> None:
        """A photo's entry in place of the one before."""
        for name in self._through.get(record.file, ()):
            self._next[name].discard(record.file)
        self._through[record.file] = record.through
        for name in record.through:
            self._next.setdefault(name, set()).add(record.file)

    def before(self, name: str) -> Collection[str]:
        """The photos through which `name` was found."""
        return self._through.get(name, ())

    def next_to(self, name: str) -> Collection[str]:
        """The photos that were found through `name` directly."""
        return self._next.get(name, ())

    def of(self, name: str) -> set[str]:
        """The photos that were found through `name`, directly or through others."""
        found: set[str] = set()
        new = set(self._next.get(name, ()))
        while new:
            found |= new
            new = {n for k in new for n in self._next.get(k, ())} - found
        return found
