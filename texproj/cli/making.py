"""The commands of the way from photos to the model: each runs one stage and tells the outcome."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter

from texproj.cli.flags import flags_for
from texproj.cli.runner import run_stage, tell
from texproj.cli.shared import Cluster, Folder, Json, Verbose, matching, project_at_work
from texproj.settings import SECTIONS

if TYPE_CHECKING:
    from texproj.stages.bench import Workbench
    from texproj.stages.progress import Progress

    RegisterFlags: TypeAlias = Any
    ColorFlags: TypeAlias = Any
    RefineFlags: TypeAlias = Any
    RunFlags: TypeAlias = Any
    RenderFlags: TypeAlias = Any
else:  # classes made from the options when the program starts
    RegisterFlags = flags_for(
        ("register", "render"), ("points", "structure", "mutual-information", "silhouette")
    )
    RefineFlags = flags_for(("refine", "render"))
    ColorFlags = flags_for(("color", "render"), ("unwrap", "patches", "output"))
    RunFlags = flags_for(
        ("render",),
        tuple(name for name in SECTIONS if name not in ("render", "preview")),
    )
    RenderFlags = flags_for(("render",))


def register(
    folder: Folder,
    /,
    *,
    photos: Annotated[str, Parameter(help="Only photos whose name matches, e.g. 'DSC_01*'.")] = "*",
    flags: RegisterFlags = None,
    cluster: Cluster = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Find the camera of each photo, where that is not known yet or stale.

    Example: texproj register statue --method points
    """
    from texproj.stages.choosing import told_of  # noqa: PLC0415
    from texproj.stages.outcomes import RegisterOutcome  # noqa: PLC0415
    from texproj.stages.registering import register_photos  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "register") as project:
        names = matching(project, photos)

        def stage(bench: Workbench, progress: Progress) -> RegisterOutcome:
            return RegisterOutcome(register_photos(bench, names, progress), told_of(project))

        return run_stage(project, json, stage, cluster)


def place(
    folder: Folder,
    number: Annotated[int, Parameter(name="NUMBER", help="As `status` tells; 0: none of them.")],
    /,
    *,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Say which of several places on the mesh is right, where the photos do not decide.

    Example: texproj place statue 1
    """
    from texproj.stages.choosing import choose  # noqa: PLC0415

    with project_at_work(folder, None, verbose, "place") as project:
        project.check_writable(project.work)
        return tell(project, choose(project, number), json)


def color(
    folder: Folder,
    /,
    *,
    flags: ColorFlags = None,
    cluster: Cluster = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Project the registered photos onto the mesh and write the model to out/.

    Example: texproj color statue --to texture
    """
    from texproj.stages.coloring import color_project  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "color") as project:
        return run_stage(project, json, color_project, cluster)


def appearance(
    folder: Folder,
    /,
    *,
    to: Annotated[
        Literal["vertices", "texture"],
        Parameter(help="Also a textured model, in place of that of `color`."),
    ] = "vertices",
    flags: RenderFlags = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Find the light of the photos and write the surface without it to out/.

    Example: texproj appearance statue
    """
    from texproj.stages.appearing import appearance_project  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "appearance") as project:
        return run_stage(project, json, lambda bench, tell: appearance_project(bench, tell, to))


def refine(
    folder: Folder,
    /,
    *,
    flags: RefineFlags = None,
    cluster: Cluster = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Bring all registered cameras to agree with each other on the surface.

    Example: texproj refine statue
    """
    from texproj.stages.refining import refine_project  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "refine") as project:
        return run_stage(project, json, refine_project, cluster)


def run(
    folder: Folder,
    /,
    *,
    flags: RunFlags = None,
    cluster: Cluster = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Register, color and report: whatever is stale of these.

    Example: texproj run statue
    """
    from texproj.stages.running import run_project  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "run") as project:
        return run_stage(project, json, run_project, cluster)


def report(
    folder: Folder,
    /,
    *,
    flags: RenderFlags = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Write out/report.html and out/report.json.

    Example: texproj report statue
    """
    from texproj.stages.reporting import report_project  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "report") as project:
        return run_stage(project, json, report_project)
