"""A verdict on cameras that another program found, before anybody vouches for them here.

Whoever has a camera of another frame, another lens or another turn of the picture has a file that
reads well and colors the model wrong. So photos are compared with each other through the mesh,
and, where no other photo shows the same, with the mesh's own edges. Method: ours; the comparison is
that of the joint refinement.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from texproj.camera import Camera
from texproj.register.joint.overlap import choose_partners, shared_views
from texproj.register.joint.session import Kept, LoadPhoto
from texproj.register.proof.alone import Glance, StructureLook, glance, look
from texproj.register.proof.pairs import PLACED_PX, PairAgreement, compare_pair
from texproj.register.proof.through_mesh import KEPT_PHOTOS, Views
from texproj.render import Render

WORKING_PX = 768
"""Longer side of the reduced photos: all thresholds are for this size."""
PARTNERS = 3
"""With how many others a photo is compared, from the nearest line of sight to the widest."""
BEHIND = 0.9
"""Share of what is seen of the mesh that is seen from behind, from which on a camera is wrong."""
LEAST_EXACT, EXACT = 0.5, 0.88
"""Of all patches found, the share in place below which a camera that one photo confirms is wrong
all the same, and from which on its lens is right too. Right cameras: .90 and more, .68 on a mesh
of few faces; a focal length off by two percent: .35 to .9."""

IN_BAD_COMPANY = (
    "it cannot be proved, and most cameras of this file that can be checked are wrong: is the file"
    " for this mesh and these photos?"
)

Standing = Literal["proved", "unproved", "contradicted"]
Pair = tuple[int, int]


@dataclass(frozen=True)
class Proof:
    """standing: proved where photo and mesh agree, contradicted where they do where the camera does
    not put them, or nowhere; unproved where neither can be told. reason: one sentence; exact: the
    lens is right too; checked: the numbers, for the report.
    """

    standing: Standing
    reason: str
    exact: bool = False
    checked: dict[str, Any] = field(default_factory=dict)

    @property
    def shares(self) -> list[float]:
        """The shares of what was sought that was found in place, each 0..1."""
        keys = ("patches_in_place", "found_in_place", "edges_in_place")
        return [float(self.checked.get(key, 0.0)) for key in keys]


@dataclass(frozen=True, eq=False)
class _Evidence:
    """What speaks for and against the camera of photo k: the pairs that it is part of."""

    pairs: Mapping[Pair, PairAgreement]
    confirmed: Collection[int]

    def of(self, k: int) -> list[PairAgreement]:
        return [a for pair, a in self.pairs.items() if k in pair and a.tells]

    def partners(self, k: int) -> set[int]:
        """The photos that photo k could be compared with."""
        return {n for pair, a in self.pairs.items() if k in pair and a.tells for n in pair} - {k}

    def blames_others(self, k: int, looks: Mapping[int, StructureLook]) -> bool:
        """Whether the edges speak for photo k and against all with which it does not agree."""
        others = [looks.get(n) for n in self.partners(k)]
        wrong = all(other is not None and other.contradicts for other in others)
        return wrong and not looks[k].contradicts

    def among_confirmed(self, k: int) -> np.ndarray:
        """Offsets of all patches that photo k shares with photos that are right by themselves."""
        chosen = [
            a.offset_px
            for pair, a in self.pairs.items()
            if k in pair and a.tells and {*pair} <= {*self.confirmed}
        ]
        return np.concatenate([np.zeros(0), *chosen])


def prove(
    cameras: Sequence[Camera],
    load_photo: LoadPhoto,
    render: Render,
    judged: Collection[int] | None = None,
) -> dict[int, Proof]:
    """A verdict by number on the cameras (full size) of `judged`, all by default; the others are
    known to be right.

    render: depth, normal and front for a camera.
    """
    judged = range(len(cameras)) if judged is None else judged
    views = Views(tuple(cameras), Kept(KEPT_PHOTOS), WORKING_PX, load_photo, render)
    pairs = _pairs(cameras, render, judged)
    found = {pair: compare_pair(*pair, views) for pair in pairs}
    right = {*range(len(cameras))} - {*judged}
    confirmed = right | {k for pair, a in found.items() if a.agrees for k in pair}
    evidence = _Evidence(found, confirmed)
    glances = {k: glance(cameras[k], render) for k in judged}
    inside_out = _inside_out(glances)
    doubted = [k for k in judged if k not in confirmed]
    looks = {k: look(load_photo(k, WORKING_PX), cameras[k], render, WORKING_PX) for k in doubted}
    proofs: dict[int, Proof] = {}
    for k in judged:
        if glances[k].from_behind >= BEHIND and not inside_out:
            proofs[k] = _behind(glances[k])
        elif k in confirmed:
            proofs[k] = _confirmed(k, evidence, cameras[k])
        else:
            proofs[k] = _unconfirmed(k, evidence, looks)
    return _as_a_file(proofs)


def _as_a_file(proofs: Mapping[int, Proof]) -> dict[int, Proof]:
    """The verdicts, in view of each other: cameras of one file are made by one program in one
    frame, so what cannot be proved by itself is as right as most of what can.
    """
    count = Counter(proof.standing for proof in proofs.values())
    if count["contradicted"] <= count["proved"]:
        return dict(proofs)
    return {
        k: replace(proof, standing="contradicted", reason=IN_BAD_COMPANY)
        if proof.standing == "unproved"
        else proof
        for k, proof in proofs.items()
    }


def _pairs(cameras: Sequence[Camera], render: Render, judged: Collection[int]) -> list[Pair]:
    """Each pair once, the later photo warped into the earlier one."""
    chosen = choose_partners(*shared_views(cameras, render), PARTNERS)
    return sorted({(min(p), max(p)) for p in chosen if {*p} & {*judged}})


def _inside_out(glances: Mapping[int, Glance]) -> bool:
    """Whether all see the mesh from behind: its faces, not the cameras, are turned."""
    return len(glances) > 1 and all(g.from_behind >= BEHIND for g in glances.values())


def _behind(seen: Glance) -> Proof:
    checked = {"from_behind": round(seen.from_behind, 3)}
    return Proof("contradicted", "this camera sees the mesh from behind", checked=checked)


def _confirmed(k: int, evidence: _Evidence, camera: Camera) -> Proof:
    """Of a camera that at least one other photo confirms."""
    offset = evidence.among_confirmed(k)
    share = max(a.share for a in evidence.of(k))
    exact = float((offset < PLACED_PX).mean()) if len(offset) else 0.0
    scale = max(1.0, max(camera.width, camera.height) / WORKING_PX)
    apart = float(np.median(offset)) * scale if len(offset) else None
    checked = {
        "proof": "other photos",
        "patches_in_place": round(share, 3),
        "found_in_place": round(exact, 3),
        "apart_px": None if apart is None else round(apart, 2),
    }
    if exact < LEAST_EXACT:
        reason = (
            f"what it shares with other photos lies {apart:.1f} px beside where the cameras put it;"
            " is the lens right?"
        )
        return Proof("contradicted", reason, checked=checked)
    return Proof("proved", "", exact >= EXACT, checked)


def _unconfirmed(k: int, evidence: _Evidence, looks: Mapping[int, StructureLook]) -> Proof:
    """Of a camera that no other photo confirms."""
    shared, alone = evidence.of(k), looks[k]
    checked = {
        "proof": "edges of the mesh",
        "edges": alone.patches,
        "edges_in_place": round(alone.fine, 3),
        "patches_in_place": round(max((a.share for a in shared), default=0.0), 3),
    }
    if alone.agrees:
        return Proof("proved", "", False, checked)
    apart = bool(shared) and all(a.contradicts for a in shared)
    if apart and not evidence.blames_others(k, looks):
        reason = (
            "no other photo shows the same surface where this camera sees it"
            f" (at best {checked['patches_in_place']:.0%} of the patches agree)"
        )
        return Proof("contradicted", reason, checked=checked)
    if not shared and alone.contradicts:
        reason = (
            f"only {alone.fine:.0%} of the mesh's edges are in the photo where this camera puts"
            " them, as by chance"
        )
        return Proof("contradicted", reason, checked=checked)
    return Proof("unproved", _untold(shared), checked={**checked, "proof": "none"})


def _untold(shared: Sequence[PairAgreement]) -> str:
    if shared:
        return "unproved: the photos that show the same agree with it only in part, or are wrong"
    return "unproved: no other photo shows enough of the same, and the mesh's edges do not tell"
