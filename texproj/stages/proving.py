"""Imported cameras before the picture: which are believed, and how turned photos were meant."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Bytes
from texproj.camera import Camera
from texproj.errors import InputError
from texproj.formats.interchange import QUARTER_TURNS
from texproj.photo import Photo
from texproj.register.joint.session import Kept
from texproj.register.proof.prove import WORKING_PX, Proof, prove
from texproj.register.proof.stencil import fits_turned
from texproj.register.proof.through_mesh import KEPT_PHOTOS
from texproj.render import GBuffer
from texproj.stages.bench import Workbench
from texproj.stages.readings import Reading, Readings, Turn

CHANNELS = ("depth", "normal", "front")
RANK = {"proved": 2.0, "unproved": 1.0, "contradicted": 0.0}
LYING_MASK = (
    "its mask fits the mesh only after EXIF's turn: it was made on the stored picture; turn the"
    " mask file the same way"
)
NO_PROOF = Proof("unproved", "unproved: the photo cannot be compared with others")


@dataclass(frozen=True, eq=False)
class Believed:
    """By photo: the reading that was taken, and the verdict on it."""

    readings: dict[str, Reading]
    proofs: dict[str, Proof]


def believe(
    bench: Workbench, found: Mapping[str, Readings], known: Mapping[str, Camera], prove_all: bool
) -> Believed:
    """Decide how turned photos are meant, and prove all cameras.

    found: what the file may mean, by photo; known: cameras of other photos that are right;
    prove_all: prove where nothing has to be decided, too.
    """
    doubtful = {name for name, one in found.items() if one.doubtful}
    if not doubtful:
        taken = {name: one.best("upright") for name, one in found.items()}
        return Believed(taken, _proofs(bench, taken, known, {*taken}) if prove_all else {})
    first, second = _likeliest(found)
    trial = _trial(bench, found, known, first)
    if all(trial.proofs[name].standing == "proved" for name in doubtful):
        return trial
    rival = _trial(bench, found, known, second)
    return rival if _score(rival, doubtful) > _score(trial, doubtful) else trial


def _likeliest(found: Mapping[str, Readings]) -> tuple[Turn, Turn]:
    """What the program did with turned photos, by what the file itself tells of each."""
    votes = Counter(one.told for one in found.values() if one.told is not None)
    if votes["stored"] > votes["upright"]:
        return "stored", "upright"
    return "upright", "stored"


def _trial(
    bench: Workbench, found: Mapping[str, Readings], known: Mapping[str, Camera], turn: Turn
) -> Believed:
    taken = {name: one.best(turn) for name, one in found.items()}
    return Believed(taken, _proofs(bench, taken, known, {*taken}))


def _score(trial: Believed, doubtful: set[str]) -> float:
    """How many turned photos the picture proves; where it proves none, how far it agrees."""
    proofs = [trial.proofs[name] for name in doubtful]
    return sum(RANK[proof.standing] + sum(proof.shares) / 4 for proof in proofs)


def _proofs(
    bench: Workbench,
    taken: Mapping[str, Reading],
    known: Mapping[str, Camera],
    judged: set[str],
) -> dict[str, Proof]:
    photos: Kept[str, Photo] = Kept(KEPT_PHOTOS)

    def load(name: str) -> Photo:
        return photos.fetch(name, lambda: bench.project.load_photo(name, WORKING_PX))

    cameras = {name: reading.camera for name, reading in taken.items()}
    cameras |= {name: camera for name, camera in known.items() if name not in cameras}
    cameras = {name: camera for name, camera in cameras.items() if _can_be_read(load, name)}
    names = list(cameras)

    def render(camera: Camera) -> GBuffer:
        return bench.plain_scene.gbuffer(camera, CHANNELS)

    numbers = [k for k, name in enumerate(names) if name in judged]
    found = prove([cameras[name] for name in names], lambda k, _: load(names[k]), render, numbers)
    proofs = {names[k]: proof for k, proof in found.items()}
    return {name: proofs.get(name, NO_PROOF) for name in judged}


def lying_mask(bench: Workbench, name: str, camera: Camera) -> str:
    """A sentence about a mask that was painted on the stored picture of a photo that EXIF turns,
    where its shape does not tell; empty if it fits as it is.
    """
    project = bench.project
    turns = QUARTER_TURNS.get(project.photo_info(name).orientation, 0)
    if not turns or not project.mask_files(name):
        return ""
    mask = project.load_photo(name, WORKING_PX).mask
    if mask is None or (turns % 2 and mask.shape[0] != mask.shape[1]):
        return ""

    def turn(picture: Bytes) -> Bytes:
        return np.ascontiguousarray(np.rot90(picture, -turns))

    def render(seen: Camera) -> GBuffer:
        return bench.plain_scene.gbuffer(seen, ("depth",))

    return LYING_MASK if fits_turned(mask, camera, render, turn) else ""


def _can_be_read(load: Callable[[str], Photo], name: str) -> bool:
    try:
        load(name)
    except InputError:  # who uses the photo says so
        return False
    return True
