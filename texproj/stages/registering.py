"""Stage `register`: a camera for each photo, photo by photo, and a verdict on each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from texproj.camera import Intrinsics
from texproj.errors import InputError, RegistrationError, TexprojError
from texproj.files import json_hash
from texproj.formats.cameras import entry_of_record
from texproj.project import Project
from texproj.records import CameraRecord, Fit, Method
from texproj.stages.bench import Workbench
from texproj.stages.entries import (
    BEFORE_KEY,
    START_KEY,
    Entries,
    camera_hash,
    foreign,
    found_through,
    in_order,
    own_registration,
    resting_on,
    start_of,
)
from texproj.stages.freshness import (
    Freshness,
    Inputs,
    changed_inputs,
    file_inputs,
    options_inputs,
)
from texproj.stages.methods import Neighbors, find_by_others, find_camera, has_means
from texproj.stages.progress import Progress, silent

STAGE = "register"
VERSION = 1
SECTIONS = ("register", "points", "structure", "mutual-information", "silhouette", "render")
UNUSABLE = "unusable_input"
"""Key of an entry's quality: a file of the photo cannot be read, so nothing else is tried."""
OTHERS = "other registered photos"

Find = Callable[[Workbench, str, CameraRecord | None, Neighbors], Fit]


@dataclass(frozen=True, eq=False)
class PhotoOutcome:
    """What became of one photo: its entry, whether it was done now or kept, and why."""

    name: str
    record: CameraRecord
    kept: bool
    reason: str

    @property
    def failed(self) -> bool:
        return self.record.status == "failed"

    @property
    def may_be_helped(self) -> bool:
        """Whether other photos could find what its own means did not."""
        return self.failed and not self.record.quality.get(UNUSABLE)


def register_photos(
    bench: Workbench, names: Sequence[str] | None = None, progress: Progress = silent
) -> list[PhotoOutcome]:
    """Register the photos `names` (all by default) whose result is stale; write cameras.json.

    A photo that fails stops no other. Each result is written as soon as it is there, so that an
    interrupted run goes on where it stopped. Raises InputError for an unusable project, OutputError
    for one that cannot be written.
    """
    project = bench.project
    project.check_writable(project.work)
    entries = project.load_cameras()
    chosen = list(names) if names is not None else project.photo_names
    outcomes: dict[str, PhotoOutcome] = {}
    auto = project.settings.register.method == "auto"
    able = [n for n in chosen if not auto or has_means(project, n, start_of(entries.get(n)))]
    waiting = _shaken(project, chosen, entries)

    def attend(name: str, find: Find) -> None:
        progress(STAGE, min(len(outcomes), len(chosen) - 1), len(chosen), name)
        outcomes[name] = _register_one(bench, name, entries, find, waiting - {*outcomes})
        entries[name] = outcomes[name].record

    for name in able:
        if not found_through(entries.get(name)):
            attend(name, find_camera)
    waiting = _shaken(project, chosen, entries)
    for name in in_order(chosen, entries):
        if name in able and name not in outcomes:
            attend(name, find_camera)
        if name not in outcomes:
            attend(name, find_by_others)
        elif auto and outcomes[name].may_be_helped:
            attend(name, partial(find_by_others, earlier=outcomes[name].reason))
    progress(STAGE, len(chosen), len(chosen), "")
    project.save_hashes()
    return [outcomes[name] for name in chosen]


def registration_freshness(project: Project) -> list[Freshness]:
    """For each photo, whether its registration is up to date."""
    entries = project.load_cameras()
    shaken = _shaken(project, project.photo_names, entries)
    states = [_freshness(project, name, entries) for name in project.photo_names]
    return [_after_others(s, entries, shaken) if s.fresh else s for s in states]


def _after_others(state: Freshness, entries: Entries, shaken: set[str]) -> Freshness:
    """A fresh photo's state, in view of those through which it was found."""
    if state.item not in shaken:
        return state
    told = ", ".join(found_through(entries[state.item]))
    return replace(state, fresh=False, reason=f"found through {told}, which are not all fresh")


def _shaken(project: Project, names: Sequence[str], entries: Entries) -> set[str]:
    """Of `names`, what was found through other photos and does not hold any more, since it is
    stale or one of those is.
    """
    stale: dict[str, bool] = {}
    for name in in_order(names, entries):
        through = found_through(entries.get(name))
        stale[name] = any(stale.get(n) for n in through)
        stale[name] = stale[name] or not _freshness(project, name, entries).fresh
    return {name for name in stale if stale[name] and found_through(entries.get(name))}


def _register_one(
    bench: Workbench, name: str, entries: Entries, find: Find, waiting: set[str]
) -> PhotoOutcome:
    project = bench.project
    entry = entries.get(name)
    state = _freshness(project, name, entries)
    if entry is not None and state.fresh:
        return PhotoOutcome(name, entry, True, entry.quality.get("reason", "") or state.reason)
    start = start_of(entry)
    neighbors = _neighbors(project, name, entries, waiting)
    record = _attempt(find, bench, name, start, neighbors)
    if entry is not None:
        record = replace(record, extra={**foreign(entry), **record.extra})
    inputs = _inputs(project, name, {**entries, name: record})
    if find is find_camera and OTHERS in inputs:
        inputs[OTHERS] = "not compared yet"
    project.save_registration([record], STAGE, name, {"inputs": inputs})
    return PhotoOutcome(name, record, False, record.quality.get("reason", ""))


def _freshness(project: Project, name: str, entries: Entries) -> Freshness:
    entry = entries.get(name)
    if entry is None:
        return Freshness(STAGE, name, False, "not registered yet")
    if _is_external(project, entry):
        return Freshness(STAGE, name, True, "registered elsewhere, kept as it is")
    if entry.status == "prior":
        return Freshness(STAGE, name, False, "not registered yet, there is a start camera")
    record = project.load_record(STAGE, name)
    reason = changed_inputs(record, _inputs(project, name, entries))
    return Freshness(STAGE, name, not reason, reason)


def _neighbors(project: Project, name: str, entries: Entries, waiting: set[str]) -> Neighbors:
    """Registered cameras of other photos, those next in the order of names first.

    Photos that wait to be registered again, or that were found through `name` themselves, prove
    nothing.
    """
    rank = {n: k for k, n in enumerate(sorted({name, *entries}))}
    apart = waiting | resting_on(name, entries) | {name}
    present = [n for n in entries if n in project.photo_paths and n not in apart]
    others = sorted(present, key=lambda n: abs(rank[n] - rank[name]))
    found = {n: entries[n].registered_camera for n in others}
    return {n: c for n, c in found.items() if c is not None}


def _is_external(project: Project, entry: CameraRecord) -> bool:
    """A camera that somebody else vouches for; a method named in the settings overrides that."""
    asked = project.settings.register.method
    return asked == "auto" and entry.status == "registered" and START_KEY not in entry.extra


def _inputs(project: Project, name: str, entries: Entries) -> Inputs:
    entry = entries.get(name)
    start = start_of(entry)
    files = {
        "mesh": project.mesh_path,
        "photo": project.photo_path(name),
        "mask": project.mask_path(name),
        "correspondences": project.correspondences_path(name),
    }
    inputs = {
        **options_inputs(project, VERSION, *SECTIONS),
        **file_inputs(project, **files),
        "start camera": json_hash(entry_of_record(start)) if start else "none",
    }
    if entry is None or not _registered_before_refinement(entry):
        others = {n for n, e in entries.items() if e.registered_camera and n != name}
        others &= project.photo_paths.keys()
        inputs[OTHERS] = json_hash({n: camera_hash(own_registration(entries[n])) for n in others})
    elif entry.method == "features" and START_KEY in entry.extra:
        inputs |= _through_inputs(project, entry, entries)
    return inputs


def _through_inputs(project: Project, entry: CameraRecord, entries: Entries) -> Inputs:
    """The photos through which an entry was found: what they show, and from where by themselves."""
    through = found_through(entry)
    if not through:
        return {"which photos it was found through": "unknown"}
    found: Inputs = {}
    for name in through:
        other = entries.get(name)
        camera = camera_hash(own_registration(other)) if other else "none"
        picture = project.hash_of(project.photo_paths.get(name))
        found[f"registration of {name}"] = json_hash([camera, picture])
    return found


def _registered_before_refinement(entry: CameraRecord) -> bool:
    """Whether the photo's own registration succeeded, whatever the others said later."""
    return entry.status == "registered" or BEFORE_KEY in entry.extra


def _attempt(
    find: Find, bench: Workbench, name: str, start: CameraRecord | None, neighbors: Neighbors
) -> CameraRecord:
    """Try what the settings ask for; the failure of a photo becomes its entry."""
    try:
        fit = find(bench, name, start, neighbors)
    except RegistrationError as error:
        return _failed_record(bench.project, name, start, {"reason": _without_name(error, name)})
    except InputError as error:
        quality = {"reason": _without_name(error, name), UNUSABLE: True}
        return _failed_record(bench.project, name, start, quality)
    if not fit.accepted:
        return _failed_record(bench.project, name, start, fit_quality(fit), fit.method)
    return _record_of_fit(name, start, fit)


def _record_of_fit(name: str, start: CameraRecord | None, fit: Fit) -> CameraRecord:
    camera = fit.camera
    return CameraRecord(
        file=name, width=camera.width, height=camera.height,
        intrinsics=camera.intrinsics, pose=camera.pose,
        status="registered", method=fit.method,
        quality=fit_quality(fit), extra=_extra(start),
    )  # fmt: skip


def _without_name(error: Exception, name: str) -> str:
    return str(error).removeprefix(f"{name}: ")


def _failed_record(
    project: Project,
    name: str,
    start: CameraRecord | None,
    quality: dict[str, Any],
    method: Method | None = None,
) -> CameraRecord:
    intrinsics: Intrinsics | None = start.intrinsics if start else None
    width, height = _size(project, name, start)
    extra = _extra(start)
    return CameraRecord(name, width, height, intrinsics, None, "failed", method, quality, extra)


def _size(project: Project, name: str, start: CameraRecord | None) -> tuple[int, int]:
    if start is not None:
        return start.width, start.height
    try:
        info = project.photo_info(name)
    except TexprojError:  # an unreadable photo has no size; its entry says why it failed
        return 1, 1
    return info.width, info.height


def _extra(start: CameraRecord | None) -> dict[str, Any]:
    if start is None:
        return {START_KEY: None}
    entry = entry_of_record(replace(start, extra={}))
    kept = {key: value for key, value in entry.items() if key != "file"}
    return {**start.extra, START_KEY: kept}


def fit_quality(fit: Fit) -> dict[str, Any]:
    """The numbers of a fit for cameras.json and the report."""
    inlying = fit.residual_px[fit.inliers]
    quality: dict[str, Any] = {
        "expected_error_px": round(float(fit.expected_error_px), 3),
        "median_residual_px": round(float(np.median(inlying)), 3) if len(inlying) else None,
        "matches": len(fit.residual_px),
        "inliers": int(fit.inliers.sum()),
        "solved": list(fit.solved),
        "reason": fit.reason,
        **fit.quality,
    }
    if fit.names:
        rows = zip(fit.names, fit.residual_px, fit.inliers, strict=True)
        quality["picks"] = [
            {"name": n, "residual_px": round(float(r), 3), "outlier": not bool(ok)}
            for n, r, ok in rows
        ]
    return quality
