"""The commands that make pictures of a project: what each photo counts for, a turntable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter

from texproj.cli.flags import flags_for
from texproj.cli.runner import run_stage
from texproj.cli.shared import Folder, Json, Verbose, matching, project_at_work
from texproj.errors import UsageError

if TYPE_CHECKING:
    FactorFlags: TypeAlias = Any
else:  # a class made from the options when the program starts
    FactorFlags = flags_for(("color", "render"))


def factors(
    folder: Folder,
    /,
    *,
    photos: Annotated[str, Parameter(help="Only photos whose name matches, e.g. 'DSC_01*'.")] = "*",
    size: Annotated[int, Parameter(help="Longer side of the images, pixels.")] = 1024,
    flags: FactorFlags = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Write images of what each photo counts for, where, and why, to out/factors/.

    Example: texproj factors statue --photos 'DSC_01*'
    """
    from texproj.stages.inspecting import inspect_project  # noqa: PLC0415

    if not 16 <= size <= 8192:
        raise UsageError(f"--size {size} is not between 16 and 8192 pixels")
    with project_at_work(folder, flags, verbose, "factors") as project:
        names = matching(project, photos)
        return run_stage(
            project, json, lambda bench, tell: inspect_project(bench, names, size, tell)
        )


def turntable(
    folder: Folder,
    /,
    *,
    film: Annotated[
        Literal["webp", "gif", "png"],
        Parameter(help="webp: small; gif: shown everywhere; png: a picture for each frame."),
    ] = "webp",
    frames: Annotated[int, Parameter(help="Pictures of one turn.")] = 72,
    seconds: Annotated[float, Parameter(help="Seconds of one turn.")] = 6.0,
    size: Annotated[int, Parameter(help="Width and height, pixels.")] = 640,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Film the colored model once around: out/turntable.webp, .gif, or pictures.

    A scan that is open at its back is filmed to and fro in front of it.

    Example: texproj turntable statue --film gif
    """
    from texproj.stages.turning import TurntableOptions, turn_project  # noqa: PLC0415

    options = TurntableOptions(film, frames, seconds, size)
    with project_at_work(folder, None, verbose, "turntable") as project:
        return run_stage(project, json, lambda bench, tell: turn_project(bench, options, tell))
