"""Registered photos judged by each other: who agrees with whom through the mesh."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

from texproj.camera import Camera
from texproj.register.joint.overlap import Glimpse, choose_partners, samples_each, shares_of
from texproj.register.joint.session import Kept, LoadPhoto
from texproj.register.proof.agreement import WORKING_PX, Agreement, agreement
from texproj.register.proof.camps import Pair, Ruling, rulings
from texproj.register.proof.through_mesh import KEPT_PHOTOS, Views
from texproj.render import Render

PARTNERS = 3
"""With how many others a photo is compared, from the nearest line of sight to the widest."""


class Looks(Protocol):
    """Whoever looks at the photos for whom `judge` decides; they are known by their numbers."""

    def glimpses(self, most: int) -> Sequence[Glimpse]:
        """What each camera sees of the mesh, with so many places on the surface at most."""

    def agreements(self, pairs: Sequence[Pair]) -> Sequence[Agreement]:
        """Of each pair, the second photo warped into the first."""


@dataclass(frozen=True, eq=False)
class LooksHere:
    """One photo after the other, in this process. cameras: full size; load_photo, render: as for
    `prove`, depth and normal are enough.
    """

    cameras: Sequence[Camera]
    load_photo: LoadPhoto
    render: Render

    def glimpses(self, most: int) -> list[Glimpse]:
        return [Glimpse.of(camera, self.render, most) for camera in self.cameras]

    def agreements(self, pairs: Sequence[Pair]) -> list[Agreement]:
        cameras = tuple(self.cameras)
        views = Views(cameras, Kept(KEPT_PHOTOS), WORKING_PX, self.load_photo, self.render)
        return [agreement(i, j, views) for i, j in pairs]


def judge(
    cameras: Sequence[Camera], looks: Looks, judged: Collection[int], sure: Collection[int] = ()
) -> dict[int, Ruling]:
    """What other photos say of the cameras (full size, by number) of `judged`, each right within
    half a percent of the width or wrong.

    sure: those that the mesh's own edges bear out.
    """
    glimpses = looks.glimpses(samples_each(len(cameras)))
    chosen = choose_partners(*shares_of(cameras, glimpses), PARTNERS)
    pairs = sorted({(min(p), max(p)) for p in chosen if {*p} & {*judged}})
    found = dict(zip(pairs, looks.agreements(pairs), strict=True))
    told = rulings(len(cameras), found, sure)
    return {k: told[k] for k in judged}
