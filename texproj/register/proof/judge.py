"""Registered photos judged by each other: who agrees with whom through the mesh."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from texproj.camera import Camera
from texproj.register.joint.overlap import choose_partners, shared_views
from texproj.register.joint.session import Kept, LoadPhoto
from texproj.register.proof.agreement import WORKING_PX, agreement
from texproj.register.proof.camps import Ruling, rulings
from texproj.register.proof.through_mesh import KEPT_PHOTOS, Views
from texproj.render import Render

PARTNERS = 3
"""With how many others a photo is compared, from the nearest line of sight to the widest."""


def judge(
    cameras: Sequence[Camera],
    load_photo: LoadPhoto,
    render: Render,
    judged: Collection[int],
    sure: Collection[int] = (),
) -> dict[int, Ruling]:
    """What other photos say of the cameras (full size, by number) of `judged`, each right within
    half a percent of the width or wrong.

    load_photo, render: as for `prove`, depth and normal are enough; sure: those that the mesh's
    own edges bear out.
    """
    views = Views(tuple(cameras), Kept(KEPT_PHOTOS), WORKING_PX, load_photo, render)
    chosen = choose_partners(*shared_views(cameras, render), PARTNERS)
    pairs = sorted({(min(p), max(p)) for p in chosen if {*p} & {*judged}})
    found = {pair: agreement(*pair, views) for pair in pairs}
    told = rulings(len(cameras), found, sure)
    return {k: told[k] for k in judged}
