"""The command that shows what each photo counts for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

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
