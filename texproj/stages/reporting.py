"""Stage `report`: what happened, as out/report.json and out/report.html."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from texproj.errors import InputError
from texproj.files import json_hash, staging
from texproj.formats.cameras import camera_part
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.appearing import STAGE as APPEARANCE
from texproj.stages.bench import Workbench
from texproj.stages.coloring import STAGE as COLOR
from texproj.stages.coloring import color_freshness
from texproj.stages.entries import is_refined
from texproj.stages.freshness import Freshness, Inputs, changed_inputs, file_inputs, options_inputs
from texproj.stages.outcomes import Tally
from texproj.stages.progress import Progress, silent
from texproj.stages.refining import STAGE as REFINE
from texproj.version import __version__

STAGE = "report"
VERSION = 2
HTML, JSON = "report.html", "report.json"


@dataclass(frozen=True)
class ReportOutcome:
    """The files: the page first, then the numbers; kept: nothing had changed since they were
    written.
    """

    files: tuple[Path, Path]
    kept: bool

    @property
    def tally(self) -> Tally:
        return Tally(0, len(self.files), "written")

    def lines(self) -> list[str]:
        """For people."""
        return [f"{'fresh, kept:' if self.kept else 'wrote'} {path}" for path in self.files]

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {"files": [str(path) for path in self.files], "kept": self.kept}


def report_project(bench: Workbench, progress: Progress = silent) -> ReportOutcome:
    """Write the report of the project as it stands, unless it is there already. Raises InputError,
    OutputError.
    """
    project = bench.project
    files = project.out / HTML, project.out / JSON
    if report_freshness(project).fresh:
        return ReportOutcome(files, True)
    from texproj.report.page import page  # noqa: PLC0415 - slow to load
    from texproj.stages.depicting import pictures  # noqa: PLC0415

    inputs = _inputs(project)
    records = project.load_cameras()
    facts = _facts(bench, records)
    names = project.photo_names
    html = page(facts, pictures(bench, records, partial(progress, STAGE)))
    with staging(project.out) as folder:
        (folder / HTML).write_text(html, encoding="utf-8", errors="backslashreplace")
        (folder / JSON).write_text(json.dumps(facts, indent=1, default=str), encoding="utf-8")
    progress(STAGE, len(names), len(names), "")
    outputs = {path.name: project.hash_of(path) for path in files}
    project.save_record(STAGE, None, {"inputs": inputs, "outputs": outputs})
    project.save_hashes()
    return ReportOutcome(files, False)


def report_freshness(project: Project) -> Freshness:
    """Whether the report tells of the project as it stands."""
    record = project.load_record(STAGE)
    reason = changed_inputs(record, _inputs(project), project.settings.exclude)
    if record is not None and not reason:
        written = record.get("outputs", {})
        gone = [n for n in (HTML, JSON) if project.hash_of(project.out / n) != written.get(n)]
        reason = f"{', '.join(gone)} changed or missing in {project.out}" if gone else ""
    return Freshness(STAGE, HTML, not reason, reason)


def _inputs(project: Project) -> Inputs:
    shown: dict[str, Any] = {
        "mesh": project.mesh_path,
    }
    for name in project.photo_names:
        shown[name] = project.photo_path(name)
        shown[f"correspondences of {name}"] = project.picks_files(name)
    return {
        **options_inputs(project, VERSION, "refine", "render"),
        "texproj": __version__,
        "cameras": json_hash([_shown(r) for r in project.load_cameras().values()]),
        "model": json_hash(project.load_record(COLOR)),
        "what the model is not up to date with": _outdated(project),
        "refinement": json_hash((project.load_record(REFINE) or {}).get("quality")),
        "appearance": json_hash(project.load_record(APPEARANCE)),
        "what nothing uses": json_hash(project.notes),
        **file_inputs(project, **shown),
    }


def _outdated(project: Project) -> str:
    """Why the model is not what the project's inputs give; empty if it is, or if there is none."""
    return "" if project.load_record(COLOR) is None else color_freshness(project).reason


def _shown(record: CameraRecord) -> list[Any]:
    """What the report shows of a photo's camera."""
    told = [record.file, record.status, record.method, record.quality, is_refined(record)]
    return [*told, *camera_part(record).values()]


def _facts(bench: Workbench, records: dict[str, CameraRecord]) -> dict[str, Any]:
    from texproj.report.pictures import RESIDUAL_MAGNIFICATION  # noqa: PLC0415 - slow to load
    from texproj.report.verdict import verdict  # noqa: PLC0415

    project, source = bench.project, bench.source
    photos = [_photo_facts(project, name, records.get(name)) for name in project.photo_names]
    color, appearance = project.load_record(COLOR), project.load_record(APPEARANCE)
    renderer = bench.renderer
    facts = {
        "format": "texproj-report",
        "version": VERSION,
        "texproj": __version__,
        "project": project.root.resolve().name,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "renderer": {"name": renderer.name, "fallback_reason": renderer.fallback_reason},
        "residual_magnification": RESIDUAL_MAGNIFICATION,
        "summary": {
            "photos": len(photos),
            "registered": sum(p["status"] == "registered" for p in photos),
            "failed": sum(p["status"] == "failed" for p in photos),
        },
        "mesh": {
            "file": project.mesh_path.name,
            "vertices": len(source.mesh.vertices),
            "faces": len(source.mesh.faces),
            "repairs": source.repairs,
            "notes": list(source.notes),
        },
        "ignored": list(project.notes),
        "refinement": _refinement(project, records),
        **_certainty(project, records),
        "photos": photos,
        "color": color and _color_facts(color),
        "outdated": _outdated(project),
        "appearance": appearance and {**appearance, "files": list(appearance["outputs"])},
        "provenance": (color or {}).get("provenance"),
        "copyright": (color or {}).get("copyright", ""),
    }
    return {**facts, "verdict": verdict(facts)}


def _color_facts(record: dict[str, Any]) -> dict[str, Any]:
    shown = {key: record[key] for key in record if key not in ("provenance", "copyright")}
    return {**shown, "files": list(record["outputs"])}


def _refinement(project: Project, records: dict[str, CameraRecord]) -> str:
    names = project.photo_names
    registered = [records[n] for n in names if n in records and records[n].registered_camera]
    refined = sum(is_refined(r) for r in registered)
    if refined:
        return f"{refined} of {len(registered)} cameras refined together"
    if project.settings.refine.enabled:
        return "none: every camera is as its own photo was registered"
    return (
        "switched off ([refine] enabled = false): every camera is as its own photo was registered"
    )


def _certainty(project: Project, records: dict[str, CameraRecord]) -> dict[str, Any]:
    """How well refined photos agree, and how sure their place on the mesh is."""
    known = project.load_record(REFINE) if any(is_refined(r) for r in records.values()) else None
    quality = (known or {}).get("quality", {})
    return {name: quality.get(name) for name in ("agreement", "frame")}


def _photo_facts(project: Project, name: str, record: CameraRecord | None) -> dict[str, Any]:
    try:
        info = project.photo_info(name)
        size, notes = [info.width, info.height], list(info.notes)
    except InputError as error:
        size, notes = None, [str(error)]
    quality = record.quality if record else {}
    return {
        "file": name,
        "size": size,
        "status": record.status if record else "failed",
        "method": record.method if record else None,
        "reason": (quality.get("reason") or "") if record else "not registered yet",
        "quality": quality,
        "notes": notes,
    }
