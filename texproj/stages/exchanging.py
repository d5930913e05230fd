"""Cameras from other programs, checked against the mesh, and cameras for them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import numpy as np

from texproj.camera import Camera
from texproj.errors import InputError, UsageError, nearest_name
from texproj.files import staging
from texproj.formats.cameras import read_cameras
from texproj.formats.interchange import (
    READERS,
    WRITERS,
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    detect,
    upright,
)
from texproj.photo import PhotoInfo
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.bench import Workbench

ImportStatus = Literal["registered", "prior"]

TURNED = "the camera is of the upright picture; where EXIF is ignored, use the photo saved upright"
LITTLE_IN_VIEW = 0.02
"""Share of the mesh below which even the best camera of a file is worth a doubt."""
LARGE = 1e6
"""Distance of a camera from the origin above which single precision moves it by more than 0.1."""
BLIND = "this camera does not look at the mesh: is the file for this mesh, in the mesh's own frame?"
GLANCE_PX = 64
"""Longer side of the picture that decides whether a camera between vertices sees a face."""
SHOWN = 5
"""How many names a sentence lists."""


@dataclass(frozen=True, eq=False)
class ImportOutcome:
    """in_view: by imported photo, the share of the mesh's vertices that its picture holds;
    failed: photos named in the file without a usable camera there, and why; unmatched: what the
    file names and the project does not have; missing: photos that the file does not name;
    notes: by photo, what was assumed or lost; remarks: the same for the whole file.
    """

    format: str
    in_view: dict[str, float]
    failed: dict[str, str]
    unmatched: tuple[str, ...]
    missing: tuple[str, ...]
    notes: dict[str, str]
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ExportOutcome:
    """files: what was written; photos: the photos in it; notes: by photo, what is not in it."""

    format: str
    files: tuple[Path, ...]
    photos: tuple[str, ...]
    notes: dict[str, str] = field(default_factory=dict)


def import_cameras(
    bench: Workbench, path: Path, status: ImportStatus = "registered", kind: str | None = None
) -> ImportOutcome:
    """Put the cameras of another program's file into cameras.json, for the photos that it names.

    kind: the format, None to find out. Raises UsageError for an unknown format, InputError for a
    broken file and for one that has no camera for this project; nothing is written then.
    """
    readers = {**READERS, "texproj": _read_own}
    if kind is not None and kind not in readers:
        raise UsageError(f"no format {kind!r} to import from{nearest_name(kind, readers)}")
    project = bench.project
    found_kind, file = detect(path, kind)
    names = _Names(project.photo_names)

    def size_of(name: str) -> tuple[int, int] | None:
        photo = names.photo_of(name)
        if photo is None:
            return None
        info = project.photo_info(photo)
        return info.width, info.height

    model = readers[found_kind](file, size_of)
    outcome, records = _matched(bench, model, names, status)
    if not records:
        raise InputError(_nothing(project, path, outcome))
    project.save_cameras(records)
    return replace(outcome, format=found_kind)


def _read_own(path: Path, size_of: SizeOf) -> ForeignModel:
    """The cameras.json of another project, or of an earlier day."""
    records = read_cameras(path).records
    cameras = tuple(ForeignCamera(r.file, r.camera) for r in records if r.camera is not None)
    return ForeignModel(
        cameras, {r.file: "it has no camera there" for r in records if not r.camera}
    )


def export_cameras(project: Project, kind: str, to: Path | None = None) -> ExportOutcome:
    """Write the registered cameras for another program, into folder `to` (out/cameras-KIND).

    Raises UsageError for an unknown format, InputError where no camera is registered, OutputError.
    """
    if kind not in WRITERS:
        raise UsageError(f"no format {kind!r} to export to{nearest_name(kind, WRITERS)}")
    folder = to if to is not None else project.out / f"cameras-{kind}"
    paths = project.photo_paths
    shots = [
        Shot(name, _relative(paths[name], folder), camera)
        for name, entry in project.load_cameras().items()
        if name in paths and (camera := entry.registered_camera) is not None
    ]
    if not shots:
        raise InputError(f"no registered camera in {project.root}; run: texproj register")
    written = WRITERS[kind](shots, _relative(project.mesh_path, folder))
    with staging(folder) as unfinished:
        for name, content in written.files.items():
            (unfinished / name).write_bytes(content)
    files = tuple(folder / name for name in written.files)
    notes = dict(written.notes)
    for shot in shots:
        if project.photo_info(shot.name).orientation != 1:
            notes[shot.name] = "; ".join([*filter(None, [notes.get(shot.name)]), TURNED])
    return ExportOutcome(kind, files, tuple(shot.name for shot in shots), notes)


def _relative(path: Path, folder: Path) -> str:
    """`path` as seen from `folder`; absolute where there is no way between them."""
    try:
        return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
    except ValueError:  # another drive
        return path.absolute().as_posix()


# --- names


class _Names:
    """The project's photos, found by what other programs call them."""

    def __init__(self, photos: Iterable[str]) -> None:
        self._photos = list(photos)
        self._folded = _unique((name.casefold(), name) for name in self._photos)
        self._stems = _unique((Path(name).stem.casefold(), name) for name in self._photos)

    def match(self, name: str) -> tuple[str | None, int]:
        """The photo that a file calls `name`, and how loosely: 0 by name, 1 but for upper and
        lower case, 2 by the name without its ending. Folders do not matter.
        """
        last = PurePosixPath(name.replace("\\", "/")).name
        if last in self._photos:
            return last, 0
        if last.casefold() in self._folded:
            return self._folded[last.casefold()], 1
        for stem in (last, PurePosixPath(last).stem):
            if stem.casefold() in self._stems:
                return self._stems[stem.casefold()], 2
        return None, 3

    def photo_of(self, name: str) -> str | None:
        return self.match(name)[0]


def _unique(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """The pairs whose key appears once."""
    found: dict[str, list[str]] = {}
    for key, value in pairs:
        found.setdefault(key, []).append(value)
    return {key: values[0] for key, values in found.items() if len(values) == 1}


def _by_photo(cameras: Iterable[ForeignCamera], names: _Names) -> dict[str, list[ForeignCamera]]:
    """For each photo the cameras whose names fit it best."""
    fitting: dict[str, list[tuple[int, ForeignCamera]]] = {}
    for camera in cameras:
        photo, looseness = names.match(camera.name)
        if photo is not None:
            fitting.setdefault(photo, []).append((looseness, camera))
    return {
        photo: [camera for rank, camera in ranked if rank == min(r for r, _ in ranked)]
        for photo, ranked in fitting.items()
    }


# --- from a file to entries


def _matched(
    bench: Workbench, model: ForeignModel, names: _Names, status: ImportStatus
) -> tuple[ImportOutcome, list[CameraRecord]]:
    entries = bench.project.load_cameras()
    fitting = _by_photo(model.cameras, names)
    refused = {p: why for n, why in model.refused.items() if (p := names.photo_of(n)) is not None}
    failed = {photo: why for photo, why in refused.items() if photo not in fitting}
    records, in_view, notes = [], {}, {}
    for photo in sorted(fitting):
        try:
            camera, note = _checked(bench, photo, fitting[photo])
        except InputError as error:
            failed[photo] = str(error)
            continue
        in_view[photo] = _share_in_view(bench, camera)
        if note:
            notes[photo] = note
        records.append(_record(photo, camera, status, in_view[photo], entries.get(photo)))
    named = [*(c.name for c in model.cameras), *model.refused, *model.absent]
    unmatched = tuple(name for name in named if names.photo_of(name) is None)
    missing = tuple(n for n in bench.project.photo_names if n not in fitting and n not in failed)
    remarks = (*model.notes, *_remarks(records, in_view))
    return ImportOutcome("", in_view, failed, unmatched, missing, notes, remarks), records


def _checked(bench: Workbench, photo: str, found: list[ForeignCamera]) -> tuple[Camera, str]:
    """The camera for the photo as it is here. Raises InputError for one that cannot be its."""
    if len(found) > 1:
        told = ", ".join(camera.name for camera in found[:SHOWN])
        raise InputError(f"{len(found)} cameras of the file fit its name ({told})")
    camera, note = _of_size(found[0].camera, bench.project.photo_info(photo))
    if not _sees_mesh(bench, camera):
        raise InputError(BLIND)
    return camera, "; ".join(part for part in (note, *found[0].notes) if part)


def _of_size(camera: Camera, info: PhotoInfo) -> tuple[Camera, str]:
    """The camera for the upright photo. Raises InputError where the shapes differ."""
    told = f"{camera.width} x {camera.height}", f"{info.width} x {info.height}"
    note = ""
    if info.orientation != 1:
        note = "EXIF turns this photo: its camera is taken as one of the upright picture"
    if not _same_shape(camera, info) and info.orientation > 4:
        turned = upright(camera, info.orientation)
        if turned is not None and _same_shape(turned, info):
            camera, note = turned, "turned upright as EXIF says"
    if not _same_shape(camera, info):
        raise InputError(f"its camera is for {told[0]} pixels, the photo has {told[1]}")
    if (camera.width, camera.height) != (info.width, info.height):
        rescaled = f"rescaled from {told[0]} to {told[1]} pixels"
        camera, note = camera.resized(info.width, info.height), f"{note}; {rescaled}".lstrip("; ")
    return camera, note


def _same_shape(camera: Camera, info: PhotoInfo) -> bool:
    """Whether the photo is the camera's picture but for scale; a pixel of either for rounding."""
    scale = info.width / camera.width
    return abs(camera.height * scale - info.height) <= max(1.0, scale)


def _share_in_view(bench: Workbench, camera: Camera) -> float:
    """Share of the mesh's vertices (a sample of them) that lie in the picture."""
    return float(camera.inside(camera.project(bench.surface_sample)[0]).mean())


def _sees_mesh(bench: Workbench, camera: Camera) -> bool:
    """Whether anything of the mesh is in the picture: a vertex, or a face between vertices."""
    for points in (bench.surface_sample, bench.mesh.vertices):
        if camera.inside(camera.project(points)[0]).any():
            return True
    small = camera.scaled(GLANCE_PX / max(camera.width, camera.height))
    depth = bench.plain_scene.gbuffer(small, ("depth",)).depth
    return depth is not None and bool(np.isfinite(depth).any())


def _record(
    photo: str, camera: Camera, status: ImportStatus, in_view: float, old: CameraRecord | None
) -> CameraRecord:
    """The new entry; foreign keys of the old one stay, what registration kept there goes."""
    extra = dict(old.extra) if old else {}
    quality: dict[str, Any] = {"mesh_in_view": round(in_view, 4)}
    return CameraRecord(
        photo, camera.width, camera.height, camera.intrinsics, camera.pose,
        status, "import", quality, extra,
    )  # fmt: skip


def _remarks(records: Iterable[CameraRecord], in_view: Mapping[str, float]) -> Iterable[str]:
    if in_view and max(in_view.values()) < LITTLE_IN_VIEW:
        yield (
            f"no camera has more than {100 * max(in_view.values()):.1f} % of the mesh in view:"
            f" look whether the file is in the mesh's own frame and units"
        )
    far = max((np.abs(r.pose.center).max() for r in records if r.pose), default=0.0)
    if far > LARGE:
        yield f"cameras are up to {far:.3g} from the origin; nothing is rounded to single precision"


def _nothing(project: Project, path: Path, outcome: ImportOutcome) -> str:
    if not outcome.failed:
        told = ", ".join(outcome.unmatched[:SHOWN]) or "none"
        ours = ", ".join(project.photo_names[:SHOWN])
        return f"{path}: no camera for a photo of this project (it names {told}; ours are {ours})"
    if set(outcome.failed.values()) == {BLIND}:
        return (
            f"{path}: these cameras do not look at the mesh: is the file for this mesh, in the"
            f" mesh's own frame and units?"
        )
    photo, reason = next(iter(outcome.failed.items()))
    others = len(outcome.failed) - 1
    more = f" (and {others} more photos without a usable camera)" if others else ""
    return f"{path}: {photo}: {reason}{more}"
