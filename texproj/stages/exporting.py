"""Cameras for other programs."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from texproj.errors import InputError, UsageError, nearest_name
from texproj.files import staging
from texproj.formats.interchange import FISHEYE_WRITERS, WRITERS, Shot
from texproj.intake import shown, unusable_name
from texproj.project import Project

TURNED = "the camera is of the upright picture; where EXIF is ignored, use the photo saved upright"


@dataclass(frozen=True, eq=False)
class ExportOutcome:
    """files: what was written; photos: the photos in it; notes: by photo, what is not in it."""

    format: str
    files: tuple[Path, ...]
    photos: tuple[str, ...]
    notes: dict[str, str] = field(default_factory=dict)


def export_cameras(project: Project, kind: str, to: Path | None = None) -> ExportOutcome:
    """Write the registered cameras for another program, into folder `to` (out/cameras-KIND).

    Raises UsageError for an unknown format, InputError where no camera is registered, OutputError.
    """
    if kind not in WRITERS:
        raise UsageError(f"no format {kind!r} to export to{nearest_name(kind, WRITERS)}")
    folder = to if to is not None else project.out / f"cameras-{kind}"
    paths = project.photo_paths
    if unusable_name(_relative(project.photos, folder)):
        raise InputError(
            f"{shown(project.photos)}: the way there from {shown(folder)} cannot be written to a"
            " text file; rename its folders, or export into the project"
        )
    shots = [
        Shot(name, _relative(paths[name], folder), camera)
        for name, entry in project.load_cameras().items()
        if name in paths and (camera := entry.registered_camera) is not None
    ]
    if not shots:
        raise InputError(f"no registered camera in {project.root}; run: texproj register")
    shots, bent = _without_fisheyes(shots, kind)
    written = WRITERS[kind](shots, _relative(project.mesh_path, folder))
    with staging(folder) as unfinished:
        for name, content in written.files.items():
            (unfinished / name).write_bytes(content)
    files = tuple(folder / name for name in written.files)
    notes = dict(written.notes) | bent
    for shot in shots:
        if project.photo_info(shot.name).orientation != 1:
            notes[shot.name] = "; ".join([*filter(None, [notes.get(shot.name)]), TURNED])
    return ExportOutcome(kind, files, tuple(shot.name for shot in shots), notes)


def _without_fisheyes(shots: list[Shot], kind: str) -> tuple[list[Shot], dict[str, str]]:
    """The photos that a format can hold, and why others are left out. Raises InputError for none
    that it can.
    """
    if kind in FISHEYE_WRITERS:
        return shots, {}
    why = f"{kind} has no place for a fisheye; {', '.join(FISHEYE_WRITERS)} have"
    bent = {s.name: f"left out: {why}" for s in shots if s.camera.intrinsics.is_fisheye}
    kept = [shot for shot in shots if shot.name not in bent]
    if not kept:
        raise InputError(f"no camera can be exported: {why.removeprefix('left out: ')}")
    return kept, bent


def _relative(path: Path, folder: Path) -> str:
    """`path` as seen from `folder`; absolute where there is no way between them."""
    try:
        return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
    except ValueError:  # another drive
        return path.absolute().as_posix()
