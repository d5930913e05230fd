"""Through which photos each photo may be found, as one after the other is registered."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from texproj.records import CameraRecord
from texproj.stages.lineage import Lineage
from texproj.stages.neighborhood import Behind, Neighborhood


class Surroundings:
    """The registered photos next to each photo that may prove something about it.

    waiting: those without an outcome, which whoever registers them keeps up to date; shaken: those
    of them that were found through others before, so that their old cameras prove nothing; loose:
    those that were found through one that waited then, so that they may hang on it; stirred: those
    around which something has changed.
    """

    def __init__(self, near: Neighborhood, behind: Behind, waiting: Collection[str]) -> None:
        self._near, self._behind, self._waiting = near, behind, waiting
        self._shaken = {name for name in waiting if behind.before(name)}
        self._loose: set[str] = set()
        self._stirred: set[str] = set()

    @classmethod
    def of(
        cls, lineage: Lineage, waiting: Collection[str], companions: Mapping[str, Sequence[str]]
    ) -> Surroundings:
        """Those of all photos of a project, before any of those that wait has an outcome."""
        entries = lineage.entries
        registered = {n for n, entry in entries.items() if entry.vouches}
        near = Neighborhood(lineage.sources.project.photo_names, registered, companions)
        found = cls(near, Behind(entries.values()), waiting)
        for name in lineage.order:
            if name not in waiting:
                found._see_what_it_hangs_on(name)
        return found

    @property
    def registered(self) -> Collection[str]:
        """The registered photos."""
        return self._near.registered

    def knows(self, name: str) -> bool:
        """Whether it is known which photos show the same."""
        return name in self._near.companions

    def learn(self, companions: Mapping[str, Sequence[str]]) -> None:
        """From now on these photos are known to show the same."""
        self._near.companions = companions

    def around(self, name: str) -> tuple[str, ...]:
        """The registered photos next to a photo: none that is shaken, none that was found through
        it.
        """

        def proves_nothing(other: str) -> bool:
            if other in self._shaken:
                return True
            return other in self._loose and other in self._behind.of(name)

        return self._near.around(name, proves_nothing)

    def around_before(self, name: str) -> tuple[str, ...]:
        """The same as if no photo waited."""
        return self._near.around(name, self._behind.of(name).__contains__)

    def settle(self, record: CameraRecord) -> None:
        """A photo has an outcome."""
        name, was_there = record.file, self._near.has(record.file)
        self._shaken.discard(name)
        self._stirred.update(self._behind.next_to(name))
        self._behind.put(record)
        self._see_what_it_hangs_on(name)
        (self._near.add if record.vouches else self._near.remove)(name)
        if was_there or record.vouches:
            self._stirred.update(self._near.reach(name))

    def take_stirred(self) -> set[str]:
        """The photos, or a few more, around which something has changed since this was asked."""
        stirred, self._stirred = self._stirred, set()
        return stirred

    def _see_what_it_hangs_on(self, name: str) -> None:
        before = self._behind.before(name)
        hangs = any(n in self._waiting or n in self._loose for n in before)
        (self._loose.add if hangs else self._loose.discard)(name)
