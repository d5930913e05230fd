"""The command that shows what each photo counts for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from cyclopts import Parameter

from texproj.cli import talk
from texproj.cli.flags import flags_for
from texproj.cli.shared import Folder, Json, Verbose, exit_code, matching, open_project
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
    from texproj.stages.bench import Workbench  # noqa: PLC0415
    from texproj.stages.inspecting import inspect_project  # noqa: PLC0415

    project = open_project(folder, flags, verbose)
    if not 16 <= size <= 8192:
        raise UsageError(f"--size {size} is not between 16 and 8192 pixels")
    with Workbench(project) as bench, talk.progress_bars() as progress:
        outcome = inspect_project(bench, matching(project, photos), size, progress)
    if json:
        talk.say_json({**vars(outcome), "folders": {k: str(v) for k, v in outcome.folders.items()}})
    else:
        for name, path in outcome.folders.items():
            means = outcome.means[name]
            told = ", ".join(f"{factor} {mean:.2f}" for factor, mean in means.items())
            talk.say(f"{name}: wrote {path} (means: {told})")
        for name, reason in outcome.failed.items():
            talk.say(f"{name}: FAILED: {reason}")
    return exit_code(len(outcome.failed), len(outcome.failed) + len(outcome.folders), "shown")
