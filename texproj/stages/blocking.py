"""Photos that have nothing to start from are placed all together: relative to each other by
structure from motion, then, as one block, on the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from tempfile import TemporaryDirectory

import numpy as np

from texproj.camera import Camera
from texproj.errors import InputError, RegistrationError
from texproj.files import content_hash
from texproj.photo import Photo
from texproj.records import Fit
from texproj.register.block.block_fit import BlockFit
from texproj.register.block.place import place_block
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.structure_from_motion import (
    LONGEST_PX,
    BlockPhoto,
    structure_from_motion,
)
from texproj.render import GBuffer
from texproj.stages.bench import Workbench
from texproj.stages.lenses import lens_of
from texproj.stages.methods import REGISTRATION_LONGEST
from texproj.stages.progress import Progress

STAGE = "block"
LEAST_PHOTOS = 3
"""Two photos tell little of a shape."""
STEPS = 100
"""Parts of the progress while the block is put onto the mesh."""
CHANNELS = ("depth", "normal", "ao", "front")

Told = dict[str, Fit | str]


def place_together(
    bench: Workbench, names: Sequence[str], progress: Progress
) -> Mapping[str, Fit | str]:
    """A camera for each photo, or why there is none. What was found of photos and pairs is kept in
    work/, so that an interrupted run goes on where it stopped.
    """
    if len(names) < LEAST_PHOTOS:
        return {}
    photos, told = _photos(bench, names)
    if len(photos) < LEAST_PHOTOS:
        return told
    try:
        with TemporaryDirectory(prefix="texproj-block-") as scratch:
            motion = structure_from_motion(
                photos,
                partial(_load, bench, longest=LONGEST_PX),
                str(bench.project.features_path()),
                scratch,
                lambda what, done, total: progress(what, done, total, ""),
            )
    except RegistrationError as error:
        return told | {photo.name: str(error) for photo in photos}
    told |= motion.left_out
    for part in motion.parts:
        told |= _placed(bench, part, progress)
    return told


def _photos(bench: Workbench, names: Sequence[str]) -> tuple[list[BlockPhoto], Told]:
    """The photos with what is known of their lenses; and why some cannot be used."""
    project, entries = bench.project, bench.project.load_cameras()
    photos: list[BlockPhoto] = []
    broken: Told = {}
    for name in names:
        entry = entries.get(name)
        try:
            content = f"{project.hash_of(project.photo_path(name))}-"
            content += f"{project.hash_of(project.mask_path(name))}"
            photos.append(
                BlockPhoto(
                    project.photo_info(name),
                    content_hash(content.encode()),
                    lens_of(project, name, entry),
                    entry.intrinsics if entry is not None else None,
                )
            )
        except InputError as error:
            broken[name] = str(error)
    return photos, broken


def _load(bench: Workbench, name: str, longest: int) -> Photo:
    return bench.project.load_photo(name, longest)


def _placed(bench: Workbench, part: Reconstruction, progress: Progress) -> Told:
    """The cameras of a part of the photos, or why they are none."""

    def listen(what: str, share: float) -> None:
        progress(STAGE, round(share * STEPS), STEPS, what)

    def render(camera: Camera) -> GBuffer:
        return bench.scene.gbuffer(camera, CHANNELS)

    load = partial(_load, bench, longest=REGISTRATION_LONGEST)
    try:
        fit = place_block(part, bench.mesh, render, load, listen)
    except RegistrationError as error:
        return dict.fromkeys(part.names, str(error))
    return {name: _fit(name, fit, part) for name in part.names}


def _fit(name: str, block: BlockFit, part: Reconstruction) -> Fit:
    """What the block says of one of its photos."""
    camera = block.cameras[name]
    rows, _ = part.seen_from(part.names.index(name))
    error_px = block.expected_error_percent / 100 * max(camera.width, camera.height)
    return Fit(
        camera=camera,
        method="block",
        expected_error_px=error_px,
        residual_px=part.error_px[rows] * max(camera.width, camera.height) / LONGEST_PX,
        inliers=np.ones(len(rows), bool),
        covariance=np.full((6, 6), np.nan),
        accepted=block.accepted,
        reason=block.reason,
        quality={
            "block_photos": len(part.names),
            "block_points": len(rows),
            "support": round(block.support, 3),
            "rival": round(block.rival, 3),
            "mirror_t": round(block.mirror_t, 2),
        },
    )
