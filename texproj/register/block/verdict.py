"""Is a place of a block right? Why it is not to be believed, in words for people."""

from __future__ import annotations

from texproj.register.block.mirror_test import MirrorTest

LEAST_SUPPORT, LEAST_LEAD = 0.15, 2.5
"""What a place must have, in patches found and relative to the best rival elsewhere: right places
of five scenes had .28 and 2.6 at least, wrong ones .05."""


def refusal(support: float, rival: float) -> str:
    """Why a place is not to be believed; empty if it is."""
    if support < LEAST_SUPPORT:
        return (
            f"only {support:.0%} of the mesh's structure is found in the photos at the best place "
            "(is it the same object? else pick 8 points in one photo)"
        )
    if torn(support, rival):
        return (
            f"the photos fit the mesh in two places nearly as well ({support:.0%} and {rival:.0%} "
            "of its structure): pick 8 points in one photo"
        )
    return ""


def torn(support: float, rival: float) -> bool:
    """Whether the place and its rival elsewhere are both as right places are, so that whoever knows
    the thing can tell which it is.
    """
    return support >= LEAST_SUPPORT and support < LEAST_LEAD * rival


def slippery(motion: str) -> str:
    """Why a place on a mesh that is the same after a motion is not to be believed."""
    return f"the mesh looks the same when {motion}; pick 8 points in one photo"


def doubt(mirror: MirrorTest) -> str:
    """What the mirror test says against a place; empty if nothing."""
    if mirror.refused:
        return (
            "the photos fit better with left and right exchanged (is it a mirrored scan? mirror "
            "the mesh, or pick 8 points)"
        )
    if mirror.undecided:
        return (
            "the photos do not tell the mesh from its mirror image (look whether writing or "
            "damage are on the right side)"
        )
    return ""
