"""Batches of sizes in turn, until the photos are sure of a place of their block."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from texproj.register.block.decide import Judged, judged, same_place
from texproj.register.block.propose import PART_SCALES, SCALE_BATCHES, Place, Proposer
from texproj.register.block.upright import LESS_LIKELY, Upright
from texproj.register.block.verdict import torn
from texproj.register.block.witnesses import Witness

Told = Callable[[str, float], None]
"""``told(what, share)``: what is being done and the share of all that is done, 0 .. 1; whoever
listens may raise to stop the work."""

Watched = Callable[[Judged], None]
"""``watched(place)``: the best place so far."""


@dataclass(frozen=True, eq=False)
class Listener:
    """Who is told how a search goes."""

    told: Told = lambda what, share: None
    watched: Watched = lambda place: None


NOBODY = Listener()


TRIED, TRIED_OF_PARTS = 5, 2
"""Places of a batch of scales that the photos are asked about, at most; the second where block or
mesh is reduced to what it is about."""
WORTH_TRYING = 0.3
"""... and only those whose lines of sight are at least so good, relative to the best known."""
NEARBY = 0.2
"""Mean distance of the points, sizes of the block, from which the photos still lead home."""
SURE_SUPPORT = 0.45
"""Share of patches in place from which on no further sizes are tried."""


@dataclass(frozen=True, eq=False)
class Search:
    """proposers: the likeliest first; witnesses: the photos that are asked about every place;
    listener: is told of each place that is better than all before; upright: which places are
    likelier than others, where that is known.
    """

    proposers: Iterable[Proposer]
    witnesses: tuple[Witness, ...]
    listener: Listener
    upright: Upright | None = None

    def run(self) -> list[Judged]:
        """All places that the photos were asked about, the best first."""
        found: list[Judged] = []
        for k, proposer in enumerate(self.proposers):
            for j, scales in enumerate((PART_SCALES,) if proposer.part else SCALE_BATCHES):
                share = 0.6 - 0.6 / (1 + j + k)
                self.listener.told("comparing the photos' points with the mesh", share)
                places = proposer.places(scales)
                self.listener.told("asking the photos", share)
                most = TRIED_OF_PARTS if proposer.part else TRIED
                self._ask(self._worth_asking(places, found, most), found)
                if found and self._best(found).support >= SURE_SUPPORT:
                    return self._ranked(found)
        return self._ranked(found)

    def rivalry(self, best: Judged, other: Judged) -> float:
        """The support of another place, as far as it counts against the best."""
        doubted = self._likely(other) < self._likely(best)
        return other.support * (LESS_LIKELY if doubted else 1.0)

    def _likely(self, place: Judged) -> bool:
        """Whether nothing that is known beforehand speaks against a place."""
        return self.upright is None or bool(self.upright.holds(place.placed.world_from_block.R))

    def _ranked(self, found: list[Judged]) -> list[Judged]:
        return sorted(found, key=lambda j: -j.support * (1 if self._likely(j) else LESS_LIKELY))

    def _best(self, found: list[Judged]) -> Judged:
        return self._ranked(found)[0]

    def _ask(self, places: list[Place], found: list[Judged]) -> None:
        """Adds to `found`, until the photos are sure of one place and another that was tried is no
        rival; all rivals are found out.
        """
        for place in places:
            if not self._near_the_sure(place, found):
                found.append(judged(self.witnesses, place))
                if self._best(found) is found[-1]:
                    self.listener.watched(found[-1])
            if self._decided(found):
                return

    def _near_the_sure(self, place: Place, found: list[Judged]) -> bool:
        """Nothing new is to be learnt of a place from which the photos would lead to the best."""
        if not found or self._best(found).support < SURE_SUPPORT:
            return False
        return place.gap(self._best(found).place) < NEARBY

    def _worth_asking(self, places: list[Place], found: list[Judged], most: int) -> list[Place]:
        """The likely ones, and in any case one that is elsewhere."""
        sights = [p.sight for p in places] + [j.place.sight for j in found]
        least = WORTH_TRYING * max(sights, default=0.0)
        likely = [p for p in places if p.sight >= least > 0][:most]
        if not likely:
            return []
        elsewhere = [p for p in places if p.gap(likely[0]) >= NEARBY][:1]
        return likely + [p for p in elsewhere if p not in likely]

    def _decided(self, found: list[Judged]) -> bool:
        """The photos are sure of one place, and another was tried, and none is a rival."""
        if not found:
            return False
        best = self._best(found)
        if best.support < SURE_SUPPORT:
            return False
        elsewhere = [j for j in found if not same_place(self.witnesses, best, j)]
        rivals = (self.rivalry(best, j) for j in elsewhere)
        return bool(elsewhere) and not any(torn(best.support, rival) for rival in rivals)
