"""The commands that take cameras from other programs and give them away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter

from texproj.cli import talk
from texproj.cli.exits import DONE
from texproj.cli.flags import flags_for
from texproj.cli.runner import tell
from texproj.cli.shared import (
    Folder,
    Json,
    Verbose,
    exit_code,
    open_project,
    project_at_work,
)
from texproj.formats.interchange import READERS, WRITERS

SHOWN = 6
"""How many names a line lists."""

if TYPE_CHECKING:
    RenderFlags: TypeAlias = Any
else:  # a class made from the options when the program starts
    RenderFlags = flags_for(("render",))


def import_(
    folder: Folder,
    file: Annotated[
        Path,
        Parameter(name="FILE", help="The camera file, or a COLMAP folder; or named points (.pp)."),
    ],
    /,
    *,
    as_: Annotated[
        Literal["registered", "prior"],
        Parameter(name="--as", help="Vouch for the cameras, or let registration start from them."),
    ] = "registered",
    format: Annotated[
        str | None, Parameter(help=f"If the file does not tell: {', '.join(READERS)}.")
    ] = None,
    flags: RenderFlags = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Take cameras from another program: COLMAP, Metashape, RealityScan, MeshLab, others.

    Points that were named in MeshLab (.pp) complete picks that name them.

    Example: texproj import statue sparse/0
    """
    from texproj.stages.bench import Workbench  # noqa: PLC0415
    from texproj.stages.exchanging import import_cameras  # noqa: PLC0415
    from texproj.stages.named_points import SUFFIX, import_points  # noqa: PLC0415

    if file.suffix.lower() == SUFFIX:
        with project_at_work(folder, flags, verbose, "import") as project:
            return tell(project, import_points(project, file), json)
    with (
        project_at_work(folder, flags, verbose, "import") as project,
        Workbench(project) as bench,
    ):
        outcome = import_cameras(bench, file, as_, format)
    if json:
        talk.say_json(vars(outcome))
    else:
        _say_import(outcome)
    total = len(outcome.failed) + len(outcome.in_view)
    doubted = len(outcome.failed) + len(outcome.starts)
    return exit_code(
        doubted, total, "given a camera to vouch for" if outcome.starts else "given a camera"
    )


def export(
    folder: Folder,
    /,
    *,
    format: Annotated[str, Parameter(help=f"{', '.join(WRITERS)}.")],
    to: Annotated[
        Path | None, Parameter(help="The folder to write, by default DIR/out/cameras-FORMAT.")
    ] = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Write the registered cameras for another program.

    Example: texproj export statue --format colmap
    """
    from texproj.stages.exporting import export_cameras  # noqa: PLC0415

    outcome = export_cameras(open_project(folder, None, verbose), format, to)
    if json:
        talk.say_json({**vars(outcome), "files": [str(path) for path in outcome.files]})
        return DONE
    talk.say(f"wrote {len(outcome.photos)} cameras: {', '.join(map(str, outcome.files))}")
    for note, names in _by_note(outcome.notes).items():
        talk.say(f"{_some(names)}: {note}")
    return DONE


def _say_import(outcome: Any) -> None:
    for name, share in outcome.in_view.items():
        note = f" ({outcome.notes[name]})" if name in outcome.notes else ""
        word = "only a START" if name in outcome.starts else outcome.status[name]
        talk.say(f"{name}: {word}, {100 * share:.0f} % of the mesh in the picture{note}")
    for why, names in _by_note(outcome.starts).items():
        talk.say(f"{_some(names)}: not vouched for: {why}; registration starts from there")
    for name, reason in outcome.failed.items():
        talk.say(f"{name}: FAILED: {reason}")
    if outcome.unmatched:
        talk.say(f"no photo here for: {_some(outcome.unmatched)}")
    if outcome.missing:
        talk.say(f"without a camera in the {outcome.format} file: {_some(outcome.missing)}")
    for remark in outcome.remarks:
        talk.say(f"note: {remark}")


def _by_note(notes: Mapping[str, str]) -> dict[str, list[str]]:
    """The photos that share a note."""
    photos: dict[str, list[str]] = {}
    for name, note in notes.items():
        photos.setdefault(note, []).append(name)
    return photos


def _some(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
