"""Stage `register`: a camera for each photo, photo by photo, and a verdict on each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texproj.camera import Intrinsics
from texproj.errors import InputError, RegistrationError, TexprojError
from texproj.files import json_hash
from texproj.formats.cameras import entry_of_record, record_of_entry
from texproj.project import Project
from texproj.records import CameraRecord, Fit, Method
from texproj.register.points import register_points
from texproj.register.structure import register_structure
from texproj.stages.bench import Workbench
from texproj.stages.freshness import (
    Freshness,
    Inputs,
    changed_inputs,
    file_inputs,
    options_inputs,
)
from texproj.stages.progress import Progress, silent

STAGE = "register"
VERSION = 1
START_KEY = "start"
"""Key of a cameras.json entry under which the camera is kept that registration started from."""

REGISTRATION_LONGEST = 1024
"""Longer side, pixels, to which photos are reduced for matching: about a quarter of a photo."""


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


def register_photos(
    bench: Workbench, names: Sequence[str] | None = None, progress: Progress = silent
) -> list[PhotoOutcome]:
    """Register the photos `names` (all by default) whose result is stale; write cameras.json.

    A photo that fails stops no other. Each result is written as soon as it is there, so that an
    interrupted run goes on where it stopped. Raises InputError for an unusable project.
    """
    project = bench.project
    entries = project.load_cameras()
    chosen = list(names) if names is not None else project.photo_names
    outcomes = []
    for done, name in enumerate(chosen):
        progress(STAGE, done, len(chosen), name)
        outcome = _register_one(bench, name, entries)
        entries[name] = outcome.record
        outcomes.append(outcome)
    progress(STAGE, len(chosen), len(chosen), "")
    project.save_hashes()
    return outcomes


def registration_freshness(project: Project) -> list[Freshness]:
    """For each photo, whether its registration is up to date."""
    entries = project.load_cameras()
    return [_freshness(project, name, entries.get(name)) for name in project.photo_names]


def start_of(entry: CameraRecord | None) -> CameraRecord | None:
    """The camera that the registration of an entry starts from: what was there before it."""
    if entry is None or START_KEY not in entry.extra:
        return entry
    start = entry.extra[START_KEY]
    if start is None:
        return None
    return record_of_entry({"file": entry.file, **start}, f"{entry.file}: {START_KEY}")


def _register_one(bench: Workbench, name: str, entries: dict[str, CameraRecord]) -> PhotoOutcome:
    project = bench.project
    entry = entries.get(name)
    state = _freshness(project, name, entry)
    if entry is not None and state.fresh:
        return PhotoOutcome(name, entry, True, entry.quality.get("reason", "") or state.reason)
    start = start_of(entry)
    record = _attempt(bench, name, start)
    project.save_cameras([record])
    inputs = _inputs(project, name, start)
    result = json_hash(entry_of_record(record))
    project.save_record(STAGE, name, {"inputs": inputs, "result": result})
    return PhotoOutcome(name, record, False, record.quality.get("reason", ""))


def _freshness(project: Project, name: str, entry: CameraRecord | None) -> Freshness:
    if entry is None:
        return Freshness(STAGE, name, False, "not registered yet")
    if _is_external(project, entry):
        return Freshness(STAGE, name, True, "registered elsewhere, kept as it is")
    record = project.load_record(STAGE, name)
    reason = changed_inputs(record, _inputs(project, name, start_of(entry)))
    return Freshness(STAGE, name, not reason, reason)


def _is_external(project: Project, entry: CameraRecord) -> bool:
    """A camera that somebody else vouches for; a method named in the settings overrides that."""
    asked = project.settings.options("register").method
    return asked == "auto" and entry.status == "registered" and START_KEY not in entry.extra


def _inputs(project: Project, name: str, start: CameraRecord | None) -> Inputs:
    files = {
        "mesh": project.mesh_path,
        "photo": project.photo_path(name),
        "mask": project.mask_path(name),
        "correspondences": project.correspondences_path(name),
    }
    sections = ("register", "points", "structure", "render")
    start_hash = json_hash(entry_of_record(start)) if start else "none"
    return {
        **options_inputs(project, VERSION, *sections),
        **file_inputs(project, **files),
        "start camera": start_hash,
    }


def _attempt(bench: Workbench, name: str, start: CameraRecord | None) -> CameraRecord:
    """Try what the settings ask for; the failure of a photo becomes its entry."""
    try:
        fit = _fit(bench, name, start)
    except (RegistrationError, InputError) as error:
        return _failed_record(bench.project, name, start, str(error).removeprefix(f"{name}: "))
    if not fit.accepted:
        return _failed_record(bench.project, name, start, fit.reason, fit)
    return _record_of_fit(name, start, fit)


def _fit(bench: Workbench, name: str, start: CameraRecord | None) -> Fit:
    asked = bench.project.settings.options("register").method
    if asked != "auto":
        return METHODS[asked](bench, name, start)
    refusals = []
    for method in _promising(bench.project, name, start):
        try:
            fit = METHODS[method](bench, name, start)
        except RegistrationError as error:
            refusals.append(str(error))
            continue
        if fit.accepted:
            return fit
        refusals.append(fit.reason)
    raise RegistrationError("; ".join(refusals) or NOTHING_TO_START_FROM)


NOTHING_TO_START_FROM = (
    "nothing to start from: pick at least 4 points, or give an approximate camera in cameras.json"
)


def _promising(project: Project, name: str, start: CameraRecord | None) -> Iterable[Method]:
    """The methods that the project has the means for, the surest first."""
    if project.correspondences_path(name).is_file():
        yield "points"
    if start is not None and start.camera is not None:
        yield "structure"


def _by_points(bench: Workbench, name: str, start: CameraRecord | None) -> Fit:
    project = bench.project
    picks = project.load_correspondences(name)
    if picks is None:
        path = project.correspondences_path(name)
        raise RegistrationError(f"no picks at {path}; pick at least 4 points")
    prior = start.intrinsics if start else None
    pose = start.pose if start else None
    options = project.settings.options("points")
    info = project.photo_info(name)
    return register_points(info, picks, prior, options, pose, bench.surface_sample)


def _by_structure(bench: Workbench, name: str, start: CameraRecord | None) -> Fit:
    if start is None or start.camera is None:
        raise RegistrationError(NOTHING_TO_START_FROM)
    photo = bench.project.load_photo(name, REGISTRATION_LONGEST)
    options = bench.project.settings.options("structure")
    return register_structure(photo, start.camera, bench.render, options)


METHODS: dict[str, Callable[[Workbench, str, CameraRecord | None], Fit]] = {
    "points": _by_points,
    "structure": _by_structure,
}


def _record_of_fit(name: str, start: CameraRecord | None, fit: Fit) -> CameraRecord:
    camera = fit.camera
    return CameraRecord(
        file=name, width=camera.width, height=camera.height,
        intrinsics=camera.intrinsics, pose=camera.pose,
        status="registered", method=fit.method,
        quality=fit_quality(fit), extra=_extra(start),
    )  # fmt: skip


def _failed_record(
    project: Project, name: str, start: CameraRecord | None, reason: str, fit: Fit | None = None
) -> CameraRecord:
    intrinsics: Intrinsics | None = start.intrinsics if start else None
    width, height = _size(project, name, start)
    quality = {**(fit_quality(fit) if fit else {}), "reason": reason}
    method = fit.method if fit else None
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
