"""Photos that have nothing to start from are placed all together: relative to each other by
structure from motion, then, as one block, on the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from tempfile import TemporaryDirectory

import numpy as np

from texproj.arrays import Doubles
from texproj.errors import InputError, RegistrationError
from texproj.records import CHOSEN, CameraRecord
from texproj.register.block.place import Beforehand
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.structure_from_motion import (
    LONGEST_PX,
    BlockPhoto,
    structure_from_motion,
)
from texproj.resources.memory import return_freed_memory, trim
from texproj.stages.bench import Workbench
from texproj.stages.block_fits import Told, load_reduced
from texproj.stages.block_holding import held
from texproj.stages.block_search import searched
from texproj.stages.block_tasks import BlockByCrew
from texproj.stages.choosing import chosen_fits
from texproj.stages.entries import start_of
from texproj.stages.lenses import lens_of
from texproj.stages.partners import content_key, keep_graph
from texproj.stages.progress import Progress
from texproj.standing import AXES

STAGE = "block"
LEAST_PHOTOS = 3
"""Two photos tell little of a shape."""


def place_together(
    bench: Workbench,
    names: Sequence[str],
    anchors: Mapping[str, CameraRecord],
    progress: Progress,
) -> Told:
    """A camera for each of the photos `names`, or why there is none.

    anchors: registered photos, which hold the block on the mesh where it contains any; of them
    those are told, too, that the others do not bear out. What was found of photos and pairs is kept
    in work/, so that an interrupted run goes on where it stopped.
    """
    return_freed_memory()
    others = [n for n, entry in anchors.items() if CHOSEN not in entry.quality]
    chosen = chosen_fits(bench.project, names, others)
    if chosen:
        rest = [name for name in names if name not in chosen]
        return chosen | place_together(bench, rest, anchors, progress) if rest else chosen
    photos, told = _photos(bench, [*names, *anchors])
    if len(photos) < LEAST_PHOTOS:
        return _of(names, told)
    try:
        with TemporaryDirectory(prefix="texproj-block-") as scratch:
            motion = structure_from_motion(
                photos,
                partial(load_reduced, bench, longest=LONGEST_PX),
                str(bench.project.features_path()),
                scratch,
                lambda what, done, total: progress(what, done, total, ""),
                None if bench.crew is None else BlockByCrew(bench.crew),
            )
    except RegistrationError as error:
        refused: Told = dict.fromkeys(names, str(error))
        return refused | told
    keep_graph(bench.project, motion.graph)
    told = _of(names, {**told, **motion.left_out})
    known = Beforehand(
        {photo.name for photo in photos if photo.intrinsics is not None},
        _up(bench),
        {photo.name: photo.info.up_in_cam for photo in photos},
    )
    for part in motion.parts:
        if {*part.names} & {*names}:
            told |= _placed(bench, part, anchors, known, progress)
    trim()
    return told


def _up(bench: Workbench) -> Doubles | None:
    stands = bench.project.settings.stands
    return None if stands is None else np.array(AXES[stands], np.float64)


def _of(names: Sequence[str], told: Told) -> Told:
    return {name: told[name] for name in names if name in told}


def _photos(bench: Workbench, names: Sequence[str]) -> tuple[list[BlockPhoto], Told]:
    """The photos with what is known of their lenses; and why some cannot be used."""
    project, entries = bench.project, bench.project.load_cameras()
    photos: list[BlockPhoto] = []
    broken: Told = {}
    for name in names:
        start = start_of(entries.get(name))
        try:
            photos.append(
                BlockPhoto(
                    project.photo_info(name),
                    content_key(project, name),
                    lens_of(project, name, start),
                    start.intrinsics if start is not None else None,
                )
            )
        except InputError as error:
            broken[name] = str(error)
    return photos, broken


def _placed(
    bench: Workbench,
    part: Reconstruction,
    anchors: Mapping[str, CameraRecord],
    known: Beforehand,
    progress: Progress,
) -> Told:
    """The cameras of a part of the photos, or why they are none."""
    own = {name: anchors[name] for name in part.names if name in anchors}
    try:
        if own:
            return held(bench, part, own, known, progress)
        return searched(bench, part, known, progress, asking=True)
    except RegistrationError as error:
        return {name: str(error) for name in part.names if name not in own}
