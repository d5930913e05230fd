"""What a report of a fault needs, in one file: the log, settings, cameras, records and what the
machine offers; no photo, no mesh, no mask.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterable
from pathlib import Path

from texproj.doctor import Finding
from texproj.errors import OutputError, UsageError
from texproj.files import write_atomically

TOGETHER = ("project.toml", "cameras.json", "correspondences/*.csv", "out/report.json")
MADE = ("work/log/*", "work/*.json", "work/*/*.json")
MOST_BYTES = 20_000_000
"""A file larger than that tells nothing that a shorter one does not."""


def write_bundle(root: Path, findings: Iterable[Finding], target: Path) -> tuple[str, ...]:
    """Write a zip of what helps to find a fault in project `root`; return the names in it.

    Raises UsageError where there is no such project, OutputError where `target` cannot be written.
    """
    if not root.is_dir():
        raise UsageError(f"no project folder at {root}")
    names = []
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as bundle:
        lines = [f"{'ok ' if f.good else 'NO '} {f.name}: {f.detail} {f.remedy}" for f in findings]
        bundle.writestr("doctor.txt", "\n".join(lines) + "\n")
        bundle.writestr("files.json", json.dumps(_listing(root), indent=1))
        for path in _told(root):
            name = path.relative_to(root).as_posix()
            try:
                bundle.writestr(name, path.read_bytes())
            except OSError as error:
                bundle.writestr(f"{name}.missing", str(error.strerror))
            names.append(name)
    try:
        write_atomically(target, stream.getvalue())
    except OSError as error:
        raise OutputError(f"cannot write {target}: {error.strerror}") from None
    return ("doctor.txt", "files.json", *names)


def _told(root: Path) -> list[Path]:
    """The files to send: regular ones inside of the project, none of them large."""
    home = root.resolve()
    found = [path for pattern in (*TOGETHER, *MADE) for path in sorted(root.glob(pattern))]
    return [
        path
        for path in found
        if path.resolve().is_relative_to(home)
        and path.is_file()
        and path.stat().st_size <= MOST_BYTES
    ]


def _listing(root: Path) -> dict[str, int]:
    """The size of every file of the project, by its name."""
    files = (path for path in sorted(root.rglob("*")) if path.is_file())
    return {
        path.relative_to(root).as_posix().encode(errors="backslashreplace").decode(): (
            path.stat().st_size
        )
        for path in files
    }
