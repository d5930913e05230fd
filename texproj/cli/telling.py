"""The commands that show a project and change nothing in it by themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

from texproj.cli.exits import DONE
from texproj.cli.flags import flags_for
from texproj.cli.runner import tell
from texproj.cli.shared import Folder, Json, Verbose, open_project

if TYPE_CHECKING:
    PreviewFlags: TypeAlias = Any
else:  # a class made from the options when the program starts
    PreviewFlags = flags_for(("preview",))


def status(folder: Folder, /, *, json: Json = False, verbose: Verbose = False) -> int:
    """Tell for each result whether it is fresh, or stale and which input changed.

    Example: texproj status statue
    """
    from texproj.stages.choosing import told_of  # noqa: PLC0415
    from texproj.stages.status import StatusOutcome, project_status  # noqa: PLC0415
    from texproj.stages.story import story_of  # noqa: PLC0415

    project = open_project(folder, None, verbose)
    outcome = StatusOutcome(project_status(project), story_of(project), told_of(project))
    return tell(project, outcome, json)


def preview(folder: Folder, /, *, flags: PreviewFlags = None, verbose: Verbose = False) -> int:
    """Open the project on a web page of this machine: judge the result, pick points.

    Example: texproj preview statue --port 8765
    """
    from texproj.preview.server import serve  # noqa: PLC0415

    project = open_project(folder, flags, verbose)
    serve(project.root, project.settings.preview)
    return DONE
