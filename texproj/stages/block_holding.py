"""A block of photos of which some are registered: held there, if the others bear them out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from texproj.errors import InputError, RegistrationError
from texproj.photo import Photo
from texproj.records import THROUGH, CameraRecord, Fit
from texproj.register.block.anchor import Anchor, Anchored, anchored
from texproj.register.block.confirmation import (
    APART,
    LEAST_APART_PERCENT,
    confirmation,
)
from texproj.register.block.held_block import held_block
from texproj.register.block.place import Beforehand
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.verdict import doubt
from texproj.register.motion import motion_px
from texproj.register.proof.judge import LooksHere, judge
from texproj.stages.bench import FEATURES_LONGEST, Workbench
from texproj.stages.block_fits import (
    STAGE,
    STEPS,
    Told,
    certain,
    fit_of,
    load_reduced,
    rendered,
)
from texproj.stages.block_search import searched
from texproj.stages.entries import expected_error_px
from texproj.stages.methods import REGISTRATION_LONGEST
from texproj.stages.progress import Progress

PLACED = "placed with the others"
NOT_BORNE_OUT = "its own registration is not borne out by the other photos"
MOST_AGREE = 0.6
"""Share of the photos that must agree on the surface where the mesh has no structure to be found:
at a wrong place hardly any do."""


def held(
    bench: Workbench,
    part: Reconstruction,
    own: Mapping[str, CameraRecord],
    known: Beforehand,
    progress: Progress,
) -> Told:
    """The photos of a part where those of them that are registered put it, if the others bear them
    out; else where its shape fits the mesh. Of the registered ones only those are told that are
    not borne out: where the block has them, or why nothing bears them out.
    """
    anchors = [_anchor(bench, record) for record in own.values()]
    try:
        place = anchored(part, anchors)
    except RegistrationError:
        if part.names == tuple(own):
            raise
        return _against(bench, part, own, known, progress)
    through = [name for name in own if name not in place.contradicts]
    progress(STAGE, 0, STEPS, "asking the photos")
    load = partial(load_reduced, bench, longest=REGISTRATION_LONGEST)
    asked = confirmation(part, place, bench.mesh, partial(rendered, bench), load)
    if asked.contradicts or not (asked.agrees or _agree(bench, part, place, through)):
        return _against(bench, part, own, known, progress)
    if asked.agrees and asked.mirror.refused:
        others = {name: doubt(asked.mirror) for name in part.names if name not in own}
        return {**others, **dict.fromkeys(own, NOT_BORNE_OUT)}
    block = held_block(part, place, anchors, asked, known.calibrated)
    through = [name for name in own if name not in block.contradicts]
    quality = {"block_photos": len(part.names), THROUGH: through,
               "support": round(asked.support, 3),
               "mirror_t": round(asked.mirror.t, 2)}  # fmt: skip
    told: Told = {}
    for k, name in enumerate(part.names):
        error_px = float(block.expected_error_px[k])
        told[name] = certain(fit_of(block.cameras[k], part, k, error_px, quality))
    wrong = [name for name in own if name not in through]
    return _without(told, through, wrong, f"{NOT_BORNE_OUT}: {', '.join(through)}")


def _against(
    bench: Workbench,
    part: Reconstruction,
    own: Mapping[str, CameraRecord],
    known: Beforehand,
    progress: Progress,
) -> Told:
    """The photos of a part where its shape fits the mesh, in spite of those registered."""
    try:
        told = searched(bench, part, known, progress)
    except RegistrationError as error:
        others = {n: f"{_elsewhere([*own])}; {error}" for n in part.names if n not in own}
        return {**others, **dict.fromkeys(own, NOT_BORNE_OUT)}
    right = [name for name, record in own.items() if _is_at(bench, told[name], record)]
    wrong = [name for name in own if name not in right]
    if not wrong:
        return _without(told, right, (), "")
    for name, fit in told.items():
        if isinstance(fit, Fit) and not fit.accepted:
            told[name] = replace(fit, reason=f"{_elsewhere(wrong)}; {fit.reason}")
    return _without(told, right, wrong, NOT_BORNE_OUT)


def _elsewhere(wrong: Sequence[str]) -> str:
    return f"{', '.join(wrong)} is registered where the other photos do not bear it out"


def _is_at(bench: Workbench, fit: Fit | str, record: CameraRecord) -> bool:
    """Whether the block is sure of a place of a registered photo, and the photo is there."""
    camera = record.registered_camera
    if not isinstance(fit, Fit) or not fit.accepted or camera is None:
        return False
    apart = motion_px(fit.camera, camera, bench.surface_sample)
    sigma = np.hypot(fit.expected_error_px, expected_error_px(record))
    return bool(apart < max(APART * sigma, LEAST_APART_PERCENT / 100 * camera.width))


def _without(told: Told, right: Collection[str], wrong: Collection[str], reason: str) -> Told:
    """What is told, without the registered photos that are right, and with the reason why those
    that are `wrong` are elsewhere now, or what is said against them.
    """
    left: Told = {}
    for name, fit in told.items():
        if name in wrong:
            left[name] = reason
            if isinstance(fit, Fit) and fit.accepted:
                left[name] = replace(fit, reason=f"{PLACED}; {reason}")
        elif name not in right:
            left[name] = fit
    return left


def _agree(bench: Workbench, part: Reconstruction, place: Anchored, through: Sequence[str]) -> bool:
    """Whether most photos show the same at the same points of the surface where the anchors put
    them: of a smooth painted thing the mesh has no structure to be found.
    """
    cameras = [place.world_from_block.camera(camera) for camera in part.cameras]

    def load(k: int, longest: int) -> Photo:
        return load_reduced(bench, part.names[k], longest)

    every = range(len(part.names))
    others = [k for k in every if part.names[k] not in through] or every
    try:
        found = judge(cameras, LooksHere(cameras, load, partial(rendered, bench)), others)
    except InputError:  # a photo that cannot be read proves nothing
        return False
    agreeing = sum(bool(ruling.agree) and not ruling.against for ruling in found.values())
    return agreeing >= MOST_AGREE * len(found)


def _anchor(bench: Workbench, record: CameraRecord) -> Anchor:
    camera = record.registered_camera
    assert camera is not None
    depth = bench.plain_scene.gbuffer(camera.reduced(FEATURES_LONGEST), ("depth",)).require("depth")
    anchor = Anchor(record.file, camera, depth, expected_error_px(record))
    picks = bench.project.load_correspondences(record.file) if record.method == "points" else None
    if picks is None or not len(picks):
        return anchor
    usual = (
        bench.project.settings.points.pick_sigma_percent / 100 * max(camera.width, camera.height)
    )
    return replace(anchor, picks=picks, pick_sigma_px=usual)
