"""The masks of what stands in front of the piece, kept in work/occluders/ from run to run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from texproj.camera import Camera
from texproj.errors import OutputError
from texproj.files import json_hash, write_atomically
from texproj.photo import Photo
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.resources.scratch import Scratch
from texproj.stages.attending import attended
from texproj.stages.bench import Workbench
from texproj.stages.entries import camera_hash
from texproj.stages.freshness import Inputs, file_inputs, options_inputs
from texproj.stages.progress import Progress

if TYPE_CHECKING:
    from texproj.color.sampling.depth_images import DepthImages
    from texproj.color.sampling.photo_set import PhotoSet

STAGE = "occluders"
VERSION = 1
READ_PX = 640
"""Longer side at which photos are read for it."""


MOVING_LIGHT = ("flash", "turntable", "polarized")
"""Kinds of light that differ from photo to photo: their shadows and highlights contradict the other
photos as an occluder does.
"""


def occluders_sought(project: Project) -> bool:
    """Whether what contradicts the other photos is cut out."""
    settings = project.settings
    return settings.color.occluders and settings.light.kind not in MOVING_LIGHT


@dataclass(frozen=True, eq=False)
class Kept:
    """hidden: for each photo that has an occluder: share, hidden part of what the photo would show
    of the mesh; mask: its file; edited: whether somebody has changed that file since. depths: what
    all cameras see of the mesh, None where it was not needed.
    """

    hidden: dict[str, Any]
    depths: DepthImages | None = None


def keep_occluders(
    bench: Workbench, cameras: Mapping[str, Camera], progress: Progress, scratch: Scratch
) -> Kept:
    """Find the occluders and write their masks, unless they are known. A mask that was changed is
    never written over. Depth images are rendered into `scratch`.

    Raises OutputError.
    """
    project = bench.project
    if not occluders_sought(project):
        return Kept({})
    _check_places(project, cameras)
    record, depths = project.load_record(STAGE) or {}, None
    inputs = _inputs(project, cameras)
    if record.get("inputs") != inputs:
        photos = _reduced(bench, cameras, scratch)
        depths = photos.depths
        record = _sought(bench, photos, inputs, record.get("written", {}), progress)
        project.save_record(STAGE, None, record)
    hidden = {
        name: {**told, "mask": str(path.relative_to(project.root)), "edited": known != written}
        for name, told in record["found"].items()
        if (path := project.occluder_path(name)).is_file()
        for known, written in [(project.hash_of(path), record["written"].get(name))]
    }
    return Kept(hidden, depths)


def occluder_inputs(project: Project, name: str) -> Inputs:
    """The mask as an input of the coloring."""
    path = project.occluder_path(name)
    if not occluders_sought(project) or not path.is_file():
        return {}
    return file_inputs(project, **{f"what stands in front in {name}": path})


def _inputs(project: Project, cameras: Mapping[str, Camera]) -> Inputs:
    files = {name: project.photo_path(name) for name in cameras}
    masks = {f"mask of {name}": project.mask_files(name) for name in cameras}
    known = project.load_cameras()
    return {
        **options_inputs(project, VERSION, "render"),
        **file_inputs(project, mesh=project.mesh_path, **files, **masks),
        "cameras": json_hash([_known(known[name]) for name in cameras]),
    }


def _known(record: CameraRecord) -> list[Any]:
    return [record.file, camera_hash(record)]


def _reduced(bench: Workbench, cameras: Mapping[str, Camera], scratch: Scratch) -> PhotoSet:
    """The photos, read small, with what they see of the mesh."""
    from texproj.color.sampling.photo_set import PhotoSet  # noqa: PLC0415 - slow to load

    def read(name: str) -> Photo:
        return attended(name, partial(bench.project.load_photo, name, READ_PX))

    photos = PhotoSet(tuple(cameras), tuple(cameras.values()), read)
    return photos.seen_on(bench.mesh, bench.renderer, scratch)


def _sought(
    bench: Workbench,
    photos: PhotoSet,
    inputs: Inputs,
    written: Mapping[str, str],
    progress: Progress,
) -> dict[str, Any]:
    """The record of a new search; masks of the one before that nobody has changed go."""
    import cv2  # noqa: PLC0415 - slow to load

    from texproj.color.occluders.in_front import find_occluders  # noqa: PLC0415

    project = bench.project

    def tell(done: int, total: int) -> None:
        progress(STAGE, done, total, "")

    found = find_occluders(bench.mesh, photos, bench.renderer, tell)
    hashes = {}
    for name in photos.names:
        path, known = project.occluder_path(name), written.get(name)
        if path.is_file() and project.hash_of(path) != known:
            continue  # somebody's own
        if name in found:
            write_atomically(path, cv2.imencode(".png", found[name].free)[1].tobytes())
            hashes[name] = project.hash_of(path)
        elif path.is_file():
            path.unlink()
    shares = {name: {"share": occluder.share} for name, occluder in found.items()}
    return {"inputs": inputs, "found": shares, "written": hashes}


def _check_places(project: Project, names: Iterable[str]) -> None:
    """Raise OutputError where a folder stands in the place of a mask, or a file in that of all."""
    for name in names:
        path = project.occluder_path(name)
        if path.is_dir():
            raise OutputError(f"{path} is a folder where a mask belongs; move it away")
        if path.parent.exists() and not path.parent.is_dir():
            raise OutputError(f"{path.parent} is a file where a folder belongs; move it away")
