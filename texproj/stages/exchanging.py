"""Cameras from other programs, proved on the picture before anybody vouches for them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from texproj.camera import Camera
from texproj.errors import InputError, UsageError, excerpt, nearest_name
from texproj.formats.cameras import read_cameras
from texproj.formats.interchange import (
    READERS,
    ForeignCamera,
    ForeignModel,
    SizeOf,
    detect,
    other_models,
)
from texproj.project import Project
from texproj.records import CameraRecord, Status
from texproj.register.proof.prove import Proof
from texproj.stages.bench import Workbench
from texproj.stages.photo_names import PhotoNames, by_photo
from texproj.stages.proving import believe, lying_mask
from texproj.stages.readings import Reading, Readings, readings, with_known_focal

ImportStatus = Literal["registered", "prior"]

LITTLE_IN_VIEW = 0.02
"""Share of the mesh below which even the best camera of a file is worth a doubt."""
LARGE = 1e6
"""Distance of a camera from the origin above which single precision moves it by more than 0.1."""
BLIND = "this camera does not look at the mesh: is the file for this mesh, in the mesh's own frame?"
GLANCE_PX = 64
"""Longer side of the picture that decides whether a camera between vertices sees a face."""
SHOWN = 5
"""How many names a sentence lists."""
ROUGH = "it agrees with the other photos only roughly; run: texproj refine"


@dataclass(frozen=True, eq=False)
class ImportOutcome:
    """in_view: by imported photo, the share of the mesh's vertices that its picture holds;
    status: by imported photo, "registered", or "prior" for what registration starts from;
    starts: why a camera that was to be registered is only a start; failed: photos named in the
    file without a usable camera there, and why; unmatched: what the file names and the project
    does not have; missing: photos that the file does not name; notes: by photo, what was assumed,
    lost or could not be proved; remarks: the same for the whole file.
    """

    format: str
    in_view: dict[str, float]
    failed: dict[str, str]
    unmatched: tuple[str, ...]
    missing: tuple[str, ...]
    notes: dict[str, str]
    remarks: tuple[str, ...]
    status: dict[str, Status] = field(default_factory=dict)
    starts: dict[str, str] = field(default_factory=dict)


def import_cameras(
    bench: Workbench, path: Path, status: ImportStatus = "registered", kind: str | None = None
) -> ImportOutcome:
    """Put the cameras of another program's file into cameras.json, for the photos that it names.

    A camera that the picture contradicts is written as a start, whatever `status` asks for. kind:
    the format, None to find out. Raises UsageError for an unknown format, InputError for a broken
    file and for one that has no camera for this project; nothing is written then.
    """
    readers = {**READERS, "texproj": _read_own}
    if kind is not None and kind not in readers:
        raise UsageError(f"no format {kind!r} to import from{nearest_name(kind, readers)}")
    project = bench.project
    found_kind, file = detect(path, kind)
    names = PhotoNames(project.photo_names)
    model = readers[found_kind](file, _sizes(project, names, stored=False))
    lying = None
    if any(_orientation(project, name) != 1 for name in project.photo_names):
        lying = readers[found_kind](file, _sizes(project, names, stored=True))
    taken = _matched(bench, names, model, lying)
    outcome, records = _vouched(bench, taken, status)
    notes = (*model.notes, *other_models(path, file))
    outcome = replace(
        outcome, format=found_kind, remarks=(*notes, *outcome.remarks),
        unmatched=_unmatched(model, names),
    )  # fmt: skip
    if not records:
        raise InputError(_nothing(project, path, outcome, notes))
    project.save_cameras(records)
    return outcome


def _orientation(project: Project, name: str) -> int:
    """EXIF's orientation of a photo; 1 for one that cannot be read."""
    try:
        return project.photo_info(name).orientation
    except InputError:  # who uses the photo says so
        return 1


def _sizes(project: Project, names: PhotoNames, stored: bool) -> SizeOf:
    """Width and height of photos: of the stored picture where it lies, else of the upright one."""

    def size_of(name: str) -> tuple[int, int] | None:
        photo = names.photo_of(name)
        if photo is None:
            return None
        info = project.photo_info(photo)
        lies = stored and info.orientation > 4
        return (info.height, info.width) if lies else (info.width, info.height)

    return size_of


def _read_own(path: Path, size_of: SizeOf) -> ForeignModel:
    """The cameras.json of another project, or of an earlier day."""
    records = read_cameras(path).records
    cameras = tuple(ForeignCamera(r.file, r.camera) for r in records if r.camera is not None)
    return ForeignModel(
        cameras, {r.file: "it has no camera there" for r in records if not r.camera}
    )


def _unmatched(model: ForeignModel, names: PhotoNames) -> tuple[str, ...]:
    named = [*(c.name for c in model.cameras), *model.refused, *model.absent]
    return tuple(name for name in named if names.photo_of(name) is None)


# --- what the file may mean


@dataclass(frozen=True, eq=False)
class _Taken:
    """By photo: what its camera may mean, and why others have none."""

    readings: dict[str, Readings]
    failed: dict[str, str]


def _matched(
    bench: Workbench, names: PhotoNames, model: ForeignModel, lying: ForeignModel | None
) -> _Taken:
    fitting = by_photo(model.cameras, names)
    stored = by_photo(lying.cameras, names) if lying else {}
    refused = {p: why for n, why in model.refused.items() if (p := names.photo_of(n)) is not None}
    failed = {photo: why for photo, why in refused.items() if photo not in fitting}
    found: dict[str, Readings] = {}
    for photo in sorted(fitting):
        try:
            found[photo] = _checked(bench, photo, fitting[photo], stored.get(photo, []))
        except InputError as error:
            failed[photo] = str(error)
    return _Taken(found, failed)


def _checked(
    bench: Workbench, photo: str, found: list[ForeignCamera], stored: list[ForeignCamera]
) -> Readings:
    """What the photo's camera may mean. Raises InputError for one that cannot be its."""
    if len(found) > 1:
        told = ", ".join(excerpt(camera.name) for camera in found[:SHOWN])
        raise InputError(f"{len(found)} cameras of the file fit its name ({told})")
    info = bench.project.photo_info(photo)
    told_stored = with_known_focal(stored[0], info) if len(stored) == 1 else None
    possible = readings(with_known_focal(found[0], info), told_stored, info)
    seeing = {t: r for t, r in possible.of.items() if _sees_mesh(bench, r.camera)}
    if not seeing:
        raise InputError(BLIND)
    return replace(possible, of=seeing)


def _sees_mesh(bench: Workbench, camera: Camera) -> bool:
    """Whether anything of the mesh is in the picture: a vertex, or a face between vertices."""
    for points in (bench.surface_sample, bench.mesh.vertices):
        if camera.inside(camera.project(points)[0]).any():
            return True
    small = camera.scaled(GLANCE_PX / max(camera.width, camera.height))
    depth = bench.plain_scene.gbuffer(small, ("depth",)).depth
    return depth is not None and bool(np.isfinite(depth).any())


# --- what is believed of it


def _vouched(
    bench: Workbench, taken: _Taken, status: ImportStatus
) -> tuple[ImportOutcome, list[CameraRecord]]:
    """The entries, each with the verdict of the picture."""
    entries = bench.project.load_cameras()
    known = {
        name: camera
        for name, entry in entries.items()
        if name in bench.project.photo_paths and name not in taken.readings
        and (camera := entry.registered_camera) is not None
        and entry.quality.get("standing") != "unproved"
    }  # fmt: skip
    believed = believe(bench, taken.readings, known, status == "registered")
    failed, records = dict(taken.failed), []
    in_view: dict[str, float] = {}
    notes: dict[str, str] = {}
    starts: dict[str, str] = {}
    for photo, reading in believed.readings.items():
        proof = believed.proofs.get(photo)
        doubt = _doubt(reading, proof) if status == "registered" else ""
        old = entries.get(photo)
        if doubt and old is not None and old.registered_camera is not None:
            failed[photo] = f"{doubt} (the registered camera of this photo stays)"
            continue
        if doubt:
            starts[photo] = doubt
        in_view[photo] = _share_in_view(bench, reading.camera)
        said = [reading.note, _caveat(proof) if not doubt else ""]
        if proof is not None and not doubt:
            said.append(lying_mask(bench, photo, reading.camera))
        if any(said):
            notes[photo] = "; ".join(filter(None, said))
        given: Status = "prior" if doubt else status
        records.append(_record(photo, reading.camera, given, in_view[photo], proof, doubt, old))
    named = {*taken.readings, *taken.failed}
    missing = tuple(name for name in bench.project.photo_names if name not in named)
    given_status = {record.file: record.status for record in records}
    remarks = tuple(_remarks(records, in_view))
    outcome = ImportOutcome("", in_view, failed, (), missing, notes, remarks, given_status, starts)
    return outcome, records


def _doubt(reading: Reading, proof: Proof | None) -> str:
    """Why nobody should vouch for a camera; empty if nothing speaks against it."""
    if reading.start_only:
        return reading.start_only
    if proof is None:
        return ""
    if proof.standing == "contradicted":
        return proof.reason
    if reading.other_picture and not proof.exact:
        return reading.other_picture
    return ""


def _caveat(proof: Proof | None) -> str:
    """What to mind about a camera that is believed."""
    if proof is None or proof.standing == "contradicted":
        return ""
    if proof.standing == "proved" and not proof.exact and proof.checked.get("found_in_place"):
        return ROUGH
    return proof.reason


def _share_in_view(bench: Workbench, camera: Camera) -> float:
    """Share of the mesh's vertices (a sample of them) that lie in the picture."""
    return float(camera.inside(camera.project(bench.surface_sample)[0]).mean())


def _record(
    photo: str, camera: Camera, status: Status, in_view: float,
    proof: Proof | None, doubt: str, old: CameraRecord | None,
) -> CameraRecord:  # fmt: skip
    """The new entry; foreign keys of the old one stay, what registration kept there goes."""
    extra = dict(old.extra) if old else {}
    quality: dict[str, Any] = {"mesh_in_view": round(in_view, 4)}
    if proof is not None:
        quality |= {"standing": proof.standing, **proof.checked}
        reason = doubt or _caveat(proof)
        quality |= {"reason": reason} if reason else {}
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


def _nothing(project: Project, path: Path, outcome: ImportOutcome, notes: Iterable[str]) -> str:
    """Why a file gave no camera, with what its reader has to say."""
    said = "".join(f"; note: {note}" for note in notes)
    return f"{path}: {_no_camera(project, outcome)}{said}"


def _no_camera(project: Project, outcome: ImportOutcome) -> str:
    if not outcome.failed:
        told = ", ".join(excerpt(name) for name in outcome.unmatched[:SHOWN]) or "none"
        ours = ", ".join(project.photo_names[:SHOWN])
        return f"no camera for a photo of this project (it names {told}; ours are {ours})"
    if set(outcome.failed.values()) == {BLIND}:
        return (
            "these cameras do not look at the mesh: is the file for this mesh, in the"
            " mesh's own frame and units?"
        )
    photo, reason = next(iter(outcome.failed.items()))
    others = len(outcome.failed) - 1
    more = f" (and {others} more photos without a usable camera)" if others else ""
    return f"{photo}: {reason}{more}"
