"""The places among which somebody has to choose, where the photos do not decide."""

from __future__ import annotations

from collections.abc import Sequence

from texproj.register.block.block_fit import Candidate
from texproj.register.block.certainty import Certainty, certainty
from texproj.register.block.decide import Judged, same_place
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.verdict import torn
from texproj.register.block.witnesses import Witness

MOST = 4
"""More places than a person compares at a glance are not offered."""


def candidates(
    block: Reconstruction,
    witnesses: Sequence[Witness],
    sure: Certainty,
    elsewhere: Sequence[Judged],
) -> tuple[Candidate, ...]:
    """The best place (`sure`) and its rivals among those `elsewhere`, the best of which comes
    first, each after all `witnesses` had their say; none where the best has no rival.
    """
    rivals: list[Judged] = []
    for other in elsewhere:
        known = any(same_place(witnesses, rival, other) for rival in rivals)
        if torn(sure.support, other.support) and not known:
            rivals.append(other)
    if not rivals:
        return ()
    sures = [sure, *(certainty(witnesses, rival) for rival in rivals[: MOST - 1])]
    found = [_candidate(block, one) for one in sures]
    return tuple(sorted(found, key=lambda one: -one.support))


def _candidate(block: Reconstruction, sure: Certainty) -> Candidate:
    placed = sure.placed
    return Candidate(
        placed.world_from_block,
        placed.cameras(dict(zip(block.names, block.cameras, strict=True))),
        sure.support,
        sure.expected_percent,
    )
