"""Photos that have nothing to start from are placed all together: relative to each other by
structure from motion, then, as one block, on the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.errors import InputError, RegistrationError
from texproj.photo import Photo
from texproj.records import THROUGH, CameraRecord, Fit
from texproj.register.block.anchor import Anchor, anchored
from texproj.register.block.place import place_block
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.structure_from_motion import (
    LONGEST_PX,
    BlockPhoto,
    structure_from_motion,
)
from texproj.render import GBuffer
from texproj.resources.memory import return_freed_memory, trim
from texproj.stages.bench import FEATURES_LONGEST, Workbench
from texproj.stages.entries import expected_error_px, start_of
from texproj.stages.lenses import lens_of
from texproj.stages.methods import REGISTRATION_LONGEST
from texproj.stages.partners import content_key, keep_graph
from texproj.stages.progress import Progress

STAGE = "block"
LEAST_PHOTOS = 3
"""Two photos tell little of a shape."""
MAX_ERROR_PERCENT = 0.5
"""Expected error, percent of the longer side, beyond which a photo held by others is refused."""
CELLS = 6
"""Along each side of a picture, for telling how much of it the block's points cover."""
STEPS = 100
"""Parts of the progress while the block is put onto the mesh."""
CHANNELS = ("depth", "normal", "ao", "front")

Told = dict[str, Fit | str]


def place_together(
    bench: Workbench,
    names: Sequence[str],
    anchors: Mapping[str, CameraRecord],
    progress: Progress,
) -> Told:
    """A camera for each of the photos `names`, or why there is none.

    anchors: registered photos, which hold the block on the mesh where it contains any. What was
    found of photos and pairs is kept in work/, so that an interrupted run goes on where it stopped.
    """
    return_freed_memory()
    photos, told = _photos(bench, [*names, *anchors])
    if len(photos) < LEAST_PHOTOS:
        return {name: told[name] for name in names if name in told}
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
    keep_graph(bench.project, motion.graph, {photo.name: photo.key for photo in photos})
    told |= motion.left_out
    for part in motion.parts:
        told |= _placed(bench, part, anchors, progress)
    trim()
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


def _load(bench: Workbench, name: str, longest: int) -> Photo:
    return bench.project.load_photo(name, longest)


def _placed(
    bench: Workbench,
    part: Reconstruction,
    anchors: Mapping[str, CameraRecord],
    progress: Progress,
) -> Told:
    """The cameras of a part of the photos, or why they are none."""
    own = {name: anchors[name] for name in part.names if name in anchors}
    try:
        return _held(bench, part, own) if own else _searched(bench, part, progress)
    except RegistrationError as error:
        return dict.fromkeys(part.names, str(error))


def _held(bench: Workbench, part: Reconstruction, own: Mapping[str, CameraRecord]) -> Told:
    """The photos of a part where those of them that are registered put it."""
    place = anchored(part, [_anchor(bench, record) for record in own.values()])
    through = [name for name in own if name not in place.contradicts]
    told: Told = {}
    for k, (name, camera) in enumerate(zip(part.names, part.cameras, strict=True)):
        error_px = float(place.expected_error_px[k])
        quality = {"block_photos": len(part.names), THROUGH: through}
        fit = _fit(place.world_from_block.camera(camera), part, k, error_px, quality)
        told[name] = _certain(fit)
    return told


def _anchor(bench: Workbench, record: CameraRecord) -> Anchor:
    camera = record.registered_camera
    assert camera is not None
    seen = bench.plain_scene.gbuffer(camera.reduced(FEATURES_LONGEST), ("depth",))
    return Anchor(record.file, camera, seen.require("depth"), expected_error_px(record))


def _certain(fit: Fit) -> Fit:
    """The fit, not accepted where the anchors leave it too uncertain."""
    percent = 100 * fit.expected_error_px / max(fit.camera.width, fit.camera.height)
    if percent <= MAX_ERROR_PERCENT:
        return fit
    through = ", ".join(fit.quality[THROUGH])
    reason = f"{through} leaves it uncertain by {percent:.2f} % of its longer side; pick 4 points"
    return replace(fit, accepted=False, reason=reason)


def _searched(bench: Workbench, part: Reconstruction, progress: Progress) -> Told:
    """The photos of a part where its shape fits the mesh."""

    def listen(what: str, share: float) -> None:
        progress(STAGE, round(share * STEPS), STEPS, what)

    def render(camera: Camera) -> GBuffer:
        return bench.scene.gbuffer(camera, CHANNELS)

    load = partial(_load, bench, longest=REGISTRATION_LONGEST)
    block = place_block(part, bench.mesh, render, load, listen)
    quality = {
        "block_photos": len(part.names),
        "support": round(block.support, 3),
        "rival": round(block.rival, 3),
        "mirror_t": round(block.mirror_t, 2),
    }
    told: Told = {}
    for k, name in enumerate(part.names):
        camera = block.cameras[name]
        error_px = block.expected_error_percent / 100 * max(camera.width, camera.height)
        fit = _fit(camera, part, k, error_px, quality)
        told[name] = replace(fit, accepted=fit.accepted and block.accepted, reason=block.reason)
    return told


def _fit(
    camera: Camera, part: Reconstruction, row: int, error_px: float, quality: Mapping[str, Any]
) -> Fit:
    """What a block says of one of its photos."""
    points, xy = part.seen_from(row)
    return Fit(
        camera=camera,
        method="block",
        expected_error_px=error_px,
        residual_px=part.error_px[points] * max(1.0, max(camera.width, camera.height) / LONGEST_PX),
        inliers=np.ones(len(points), bool),
        covariance=np.full((6, 6), np.nan),
        quality={**quality, "block_points": len(points), "block_cover": _cover(camera, xy)},
    )


def _cover(camera: Camera, xy: Floats) -> float:
    """Share of the picture's cells in which the photo shows a point of its block."""
    cell = np.floor(CELLS * xy / (camera.width, camera.height)).astype(int).clip(0, CELLS - 1)
    return round(len(np.unique(cell, axis=0)) / CELLS**2, 2)
