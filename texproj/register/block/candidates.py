"""The places among which somebody has to choose, where the photos do not decide."""

from __future__ import annotations

from collections.abc import Sequence

from texproj.register.block.adjusting import Asked, adjusted
from texproj.register.block.block_fit import Candidate
from texproj.register.block.certainty import certainty
from texproj.register.block.decide import Judged, same_place
from texproj.register.block.verdict import torn

MOST = 4
"""More places than a person compares at a glance are not offered."""


def candidates(asked: Asked, best: Candidate, elsewhere: Sequence[Judged]) -> tuple[Candidate, ...]:
    """The best place and its rivals among those `elsewhere`, the likeliest of which comes first,
    each after all witnesses had their say; none where the best has no rival.
    """
    rivals: list[Judged] = []
    for other in elsewhere:
        known = any(same_place(asked.witnesses, rival, other) for rival in rivals)
        if torn(best.support, other.support) and not known:
            rivals.append(other)
    if not rivals:
        return ()
    others = [adjusted(asked, r, certainty(asked.witnesses, r)) for r in rivals[: MOST - 1]]
    return tuple(sorted([best, *others], key=lambda place: -place.support))
