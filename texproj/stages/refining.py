"""Stage `refine`: all registered photos together, each anchored at its own registration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from texproj.camera import Camera
from texproj.errors import InputError
from texproj.files import json_hash
from texproj.formats.cameras import entry_of_record
from texproj.photo import Correspondences, Photo
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.resources.memory import return_freed_memory
from texproj.stages.attending import attended
from texproj.stages.bench import Workbench
from texproj.stages.entries import (
    Entries,
    expected_error_px,
    is_refined,
    own_registration,
    refined_entry,
    start_of,
)
from texproj.stages.freshness import Freshness, Inputs, changed_inputs, file_inputs, options_inputs
from texproj.stages.lenses import lens_of
from texproj.stages.outcomes import Tally
from texproj.stages.progress import Progress, silent

if TYPE_CHECKING:
    from texproj.register.joint.refine import Tell
    from texproj.register.joint.refined import Refined
    from texproj.render import GBuffer

STAGE = "refine"
VERSION = 3
BLOCK_PERCENT = 0.33
"""Freedom of a block's photos, percent of the longer side: 10 pixels of 3072."""
HELD = "what holds the frame"
GLANCE_PX = 64
"""Size at which a photo is decoded to see whether it can be."""


@dataclass(frozen=True, eq=False)
class RefineOutcome:
    """moved_px: how far the surface moved in each photo, full-size pixels; thrown_out: photos
    that contradict the others, and why; alone: photos that share too little surface with others
    to be compared, their cameras are as they were; kept: nothing had changed, so nothing was done.
    """

    moved_px: dict[str, float]
    thrown_out: dict[str, str]
    alone: tuple[str, ...]
    quality: dict[str, Any]
    kept: bool

    @property
    def tally(self) -> Tally:
        failed = len(self.thrown_out)
        return Tally(failed, len(self.moved_px) + failed, "refined")

    def lines(self) -> Iterator[str]:
        """For people."""
        if self.kept:
            yield "fresh, kept: nothing has changed since these cameras were refined"
        for name, moved in self.moved_px.items() if not self.kept else ():
            yield f"{name}: moved by {moved:.2f} px"
        for name in self.quality.get("found_again", ()) if not self.kept else ():
            yield f"{name}: contradicted the others, and was found again by what they show"
        for name in self.alone:
            yield f"{name}: stays as it is: no other photo shows enough of the same surface"
        for name, reason in self.thrown_out.items():
            yield f"{name}: FAILED: {reason}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {**vars(self)}


def refine_project(
    bench: Workbench, progress: Progress = silent, in_run: bool = False
) -> RefineOutcome:
    """Refine all registered cameras and write cameras.json.

    in_run: as a part of `run`, where imported cameras are held unless the settings say otherwise.
    Raises InputError if fewer than two photos are registered, or nothing is there to hold them,
    OutputError.
    """
    project = bench.project
    known = project.load_record(STAGE)
    if known is not None and refine_freshness(project, in_run).fresh:
        return _known_outcome(known)
    entries = project.load_cameras()
    before = {n: r for n, e in entries.items() if (r := _usable(project, n, e)) is not None}
    if len(before) < 2:
        raise InputError(f"{project.root} has fewer than two registered photos to refine together")
    project.check_writable(project.work)
    progress(STAGE, 0, 1, "")
    names, hold = list(before), _hold(project, entries, in_run)
    fixed = [hold == "imported" and not entries[n].sought for n in names]
    picks = _picks(project, before) if hold == "picks" else {}
    told = 1

    def tell(done: int, total: int) -> None:
        nonlocal told
        told = total
        progress(STAGE, done, total, f"round {done + 1} of {total} at most")

    refined = _refine(bench, before, Held(fixed, picks), tell)
    asked = not project.settings.refine.enabled
    after = _records(names, before, refined, fixed, asked)
    outcome = _outcome(names, refined, fixed)
    record = _record(before, after, outcome)
    entries |= {entry.file: entry for entry in after}
    inputs = {**_inputs(project, entries, record), HELD: hold}
    project.save_registration(after, STAGE, {None: {"inputs": inputs, **record}})
    project.save_hashes()
    progress(STAGE, told, told, "")
    return outcome


def refine_freshness(project: Project, in_run: bool) -> Freshness:
    """Whether the cameras agree as well as they can."""
    record, entries = project.load_record(STAGE), project.load_cameras()
    inputs = {**_inputs(project, entries, record or {}), HELD: _hold(project, entries, in_run)}
    reason = changed_inputs(record, inputs, project.settings.exclude)
    if record is not None and not reason:
        moved = [n for n, h in record["after"].items() if _hash(entries.get(n)) != h]
        reason = f"{', '.join(moved)} not as the refinement left it" if moved else ""
    return Freshness(STAGE, "all photos", not reason, reason)


def unrefined(project: Project) -> list[CameraRecord]:
    """The own registrations of photos that were refined while the settings had it on, though they
    have it switched off now. What somebody has refined on request since then is not among them.
    """
    if project.settings.refine.enabled:
        return []
    entries = project.load_cameras().values()
    return [
        own_registration(entry)
        for entry in entries
        if entry.refinement is not None and not entry.refinement.asked and is_refined(entry)
    ]


def undo_refinement(project: Project) -> tuple[str, ...]:
    """Where refinement is switched off now: go back to each photo's own registration in
    cameras.json; the names of these photos. Cameras that somebody has edited since then stay.
    """
    records = unrefined(project)
    if records:
        project.save_cameras(records)
    return tuple(record.file for record in records)


def _usable(project: Project, name: str, entry: CameraRecord) -> CameraRecord | None:
    """The entry as registration left it; None if it cannot take part."""
    if name not in project.photo_paths:
        return None
    entry = own_registration(entry)
    if entry.registered_camera is None:
        return None
    try:
        attended(name, lambda: project.load_photo(name, GLANCE_PX))
    except InputError:  # the color stage says so
        return None
    return entry


@dataclass(frozen=True, eq=False)
class Held:
    """What holds the frame. fixed: of each photo, must its camera not move; picks: by name."""

    fixed: list[bool]
    picks: Mapping[str, Correspondences]


def _hold(project: Project, entries: Entries, in_run: bool) -> str:
    """What the settings let hold the frame: in a run imported cameras, where there are any."""
    hold = project.settings.refine.hold
    if hold != "auto":
        return hold
    imported = any(e.registered_camera and not e.sought for e in entries.values())
    return "imported" if in_run and imported else "none"


def _picks(project: Project, before: Mapping[str, CameraRecord]) -> dict[str, Correspondences]:
    """The picks by name of the photo. Raises InputError where there are none."""
    picks = {name: project.load_correspondences(name) for name in before}
    found = {name: one for name, one in picks.items() if one is not None and len(one)}
    if not found:
        raise InputError(
            f"{project.root} has no registered photo with picks that could hold the others: pick"
            ' points in one, or set [refine] hold = "none"'
        )
    return found


def _refine(
    bench: Workbench, before: Mapping[str, CameraRecord], held: Held, tell: Tell
) -> Refined:
    from texproj.register.joint.holding import Picks  # noqa: PLC0415 - slow to load
    from texproj.register.joint.lenses import PhotoStart  # noqa: PLC0415
    from texproj.register.joint.refine import refine  # noqa: PLC0415
    from texproj.stages.tie_tasks import CHANNELS, TiesByCrew  # noqa: PLC0415

    project = bench.project
    names = list(before)

    pick_sigma = project.settings.points.pick_sigma_percent / 100

    def start(record: CameraRecord, fixed: bool) -> PhotoStart:
        known = start_of(record)
        lens = lens_of(project, record.file, known)
        given = known is not None and known.intrinsics is not None
        one = held.picks.get(record.file)
        sigma = pick_sigma * max(record.width, record.height)
        picks = None if one is None else Picks(one.xy_px, one.xyz_in_world, sigma)
        return PhotoStart(_camera(record), _sigma_px(record), lens, given, fixed, picks)

    def load(number: int, longest: int) -> Photo:
        return project.load_photo(names[number], longest)

    def render(camera: Camera) -> GBuffer:
        return bench.plain_scene.gbuffer(camera, CHANNELS)

    photos = [start(record, f) for record, f in zip(before.values(), held.fixed, strict=True)]
    return_freed_memory()
    crew = None if bench.crew is None else TiesByCrew(bench.crew, names)
    return refine(photos, load, render, project.settings.refine, tell, crew)


def _sigma_px(record: CameraRecord) -> float:
    """How far a photo's own registration may be off, full-size pixels. Of a block that is told for
    all of its photos together: each by itself is free to move further.
    """
    error_px = expected_error_px(record)
    if record.method != "block":
        return error_px
    return max(error_px, BLOCK_PERCENT / 100 * max(record.width, record.height))


def _camera(record: CameraRecord) -> Camera:
    assert record.camera is not None
    return record.camera


def _records(
    names: list[str],
    before: Mapping[str, CameraRecord],
    refined: Refined,
    fixed: list[bool],
    asked: bool,
) -> list[CameraRecord]:
    """The new entries: moved, thrown out, or as they were where nothing could be said."""
    out = []
    for k, name in enumerate(names):
        record = before[name]
        if k in refined.thrown_out:
            quality = {**record.quality, "reason": refined.thrown_out[k]}
            record = replace(record, pose=None, status="failed", quality=quality)
        elif k in refined.tied and not fixed[k] and np.isfinite(refined.expected_error_px[k]):
            quality = {
                **record.quality,
                "expected_error_px": round(float(refined.expected_error_px[k]), 3),
                "moved_px": round(float(refined.motion_px[k]), 3),
            }
            camera = refined.cameras[k]
            record = replace(
                record, intrinsics=camera.intrinsics, pose=camera.pose, quality=quality
            )
        if record is not before[name]:
            record = refined_entry(record, before[name], asked)
        out.append(record)
    return out


def _outcome(names: list[str], refined: Refined, fixed: list[bool]) -> RefineOutcome:
    moved = {
        names[k]: round(float(refined.motion_px[k]), 3)
        for k in refined.tied
        if not fixed[k] and np.isfinite(refined.motion_px[k])
    }
    thrown_out = {names[k]: reason for k, reason in refined.thrown_out.items()}
    apart = set(range(len(names))) - set(refined.tied) - set(refined.thrown_out)
    alone = tuple(names[k] for k in sorted(apart))
    again = [names[k] for k in refined.found_again]
    quality = {**refined.quality, "found_again": again}
    return RefineOutcome(moved, thrown_out, alone, quality, False)


def _known_outcome(record: Mapping[str, Any]) -> RefineOutcome:
    """What the last refinement did."""
    alone = tuple(record.get("alone", ()))
    return RefineOutcome(record["moved_px"], record["thrown_out"], alone, record["quality"], True)


def _record(
    before: Mapping[str, CameraRecord], after: list[CameraRecord], outcome: RefineOutcome
) -> dict[str, Any]:
    return {
        "before": {name: json_hash(entry_of_record(entry)) for name, entry in before.items()},
        "after": {entry.file: json_hash(entry_of_record(entry)) for entry in after},
        "moved_px": outcome.moved_px,
        "thrown_out": outcome.thrown_out,
        "alone": outcome.alone,
        "quality": outcome.quality,
    }


def _inputs(project: Project, entries: Entries, record: Mapping[str, Any]) -> Inputs:
    inputs = options_inputs(project, VERSION, "refine", "render")
    inputs |= file_inputs(project, mesh=project.mesh_path)
    for name, entry in entries.items():
        if name not in project.photo_paths or entry.status == "prior":
            continue
        files = {name: project.photo_path(name), f"mask of {name}": project.mask_files(name)}
        inputs |= file_inputs(project, **files)
        inputs[f"registration of {name}"] = _registration(entry, name, record)
        if project.settings.refine.hold == "picks":
            inputs |= file_inputs(project, **{f"picks of {name}": project.picks_files(name)})
    return inputs


def _hash(entry: CameraRecord | None) -> str:
    return json_hash(entry_of_record(entry)) if entry is not None else "none"


def _registration(entry: CameraRecord, name: str, record: Mapping[str, Any]) -> str:
    """Hash of the photo's own registration, also where the entry is already the refined one."""
    current = json_hash(entry_of_record(entry))
    if record.get("after", {}).get(name) == current:
        return str(record["before"][name])
    return current
