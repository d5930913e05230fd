"""Which of several photos are contradicted by the others, and which confirmed.

Photos that agree with each other through the mesh are a camp. Where two camps see the same surface
and show nothing alike there, one of them is wrong: the smaller one, or the one that the mesh's
edges do not bear out. Method: ours.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from texproj.register.proof.agreement import Agreement

Pair = tuple[int, int]

LEAST_AGAINST = 2
"""Photos of other camps that must contradict one: a single one may be out of focus, or hidden."""
LARGER = 2.0
"""How many times larger the camp is that is believed."""


@dataclass(frozen=True)
class Ruling:
    """What the other photos say of one: numbers of those that agree and of those that contradict
    it, both as far as they were compared. share: the largest share of patches that agrees with one
    of them; chance: what chance does in that pair; camp: how many photos agree with each other,
    this one among them, directly or through others. refused: the camera is wrong; torn: it or those
    that contradict it are, and nothing tells which.
    """

    agree: tuple[int, ...] = ()
    against: tuple[int, ...] = ()
    share: float = 0.0
    chance: float = 0.0
    apart_px: float = field(default=0.0, compare=False)
    camp: int = 1
    refused: bool = False
    torn: bool = False


def rulings(
    count: int, pairs: Mapping[Pair, Agreement], sure: Collection[int]
) -> dict[int, Ruling]:
    """For each of `count` photos what the others say of it.

    sure: those that the mesh's own edges bear out, which chance and agreement cannot.
    """
    camp = _camps(count, pairs)
    size = Counter(camp)
    borne_out = {camp[k] for k in sure}
    against: dict[int, set[int]] = {k: set() for k in range(count)}
    for (i, j), found in pairs.items():
        if found.contradicts and camp[i] != camp[j]:
            against[i].add(j)
            against[j].add(i)
    by_camp: dict[int, set[int]] = {c: set() for c in size}
    for k, others in against.items():
        by_camp[camp[k]] |= others
    wrong, torn = set(), set()
    for c, others in by_camp.items():
        rival = max((camp[n] for n in others), key=lambda d: (d in borne_out, size[d]), default=c)
        if rival == c or c in borne_out or len(others) < LEAST_AGAINST:
            continue
        if rival in borne_out or size[rival] >= LARGER * size[c]:
            wrong.add(c)
        elif size[c] < LARGER * size[rival]:
            torn.add(c)
    own = _by_photo(count, pairs)
    return {
        k: replace(
            _ruling(own[k], against[k]),
            camp=size[camp[k]], refused=camp[k] in wrong, torn=camp[k] in torn,
        )
        for k in range(count)
    }  # fmt: skip


def _camps(count: int, pairs: Mapping[Pair, Agreement]) -> list[int]:
    """(count,) number of each photo's camp."""
    agreeing = [pair for pair, found in pairs.items() if found.agrees]
    i, j = zip(*agreeing, strict=True) if agreeing else ((), ())
    graph = coo_matrix(([1] * len(i), (i, j)), (count, count))
    return [int(c) for c in connected_components(graph, directed=False)[1]]


def _by_photo(count: int, pairs: Mapping[Pair, Agreement]) -> list[dict[int, Agreement]]:
    """For each photo how it agrees with those it was compared with."""
    own: list[dict[int, Agreement]] = [{} for _ in range(count)]
    for (i, j), found in pairs.items():
        own[i][j] = own[j][i] = found
    return own


def _ruling(own: Mapping[int, Agreement], against: set[int]) -> Ruling:
    told = [found for found in own.values() if found.tells]
    best = max(told, key=lambda found: found.share, default=Agreement(0, 0, 0.0))
    agree = tuple(sorted(n for n, found in own.items() if found.agrees))
    return Ruling(agree, tuple(sorted(against)), best.share, best.chance, best.apart_px)
