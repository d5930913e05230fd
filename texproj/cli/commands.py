"""The commands: each opens the project, calls one stage function and tells the outcome."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from cyclopts import App, Parameter

from texproj.cli import talk
from texproj.cli.exchange import export, import_
from texproj.cli.exits import DONE
from texproj.cli.flags import flags_for
from texproj.cli.inspecting import factors
from texproj.cli.runner import run_stage, tell
from texproj.cli.shared import Folder, Json, Verbose, matching, open_project, project_at_work
from texproj.creation import create_project
from texproj.errors import UsageError
from texproj.settings import SECTIONS
from texproj.version import __version__

app = App(name="texproj", version=__version__, help=__doc__, suppress_keyboard_interrupt=False)
app.help = (
    "Color a 3D mesh from loose photographs: register each photo to the mesh, "
    "project its color, write the model."
)

if TYPE_CHECKING:
    RegisterFlags: TypeAlias = Any
    ColorFlags: TypeAlias = Any
    RefineFlags: TypeAlias = Any
    RunFlags: TypeAlias = Any
    RenderFlags: TypeAlias = Any
    PreviewFlags: TypeAlias = Any
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
    PreviewFlags = flags_for(("preview",))


@app.command
def new(
    folder: Annotated[Path, Parameter(name="DIR", help="The folder to make.")],
    /,
    *,
    mesh: Annotated[Path, Parameter(help="The mesh: ply, obj, stl, off or glb.")],
    photos: Annotated[
        list[Path], Parameter(help="Photos, or folders of photos.", consume_multiple=True)
    ],
    link: Annotated[bool, Parameter(negative="", help="Link the files, do not copy.")] = False,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Make a project folder of a mesh and photos.

    Example: texproj new statue --mesh scan.ply --photos DCIM/
    """
    talk.talk_about_details(verbose)
    project = create_project(folder, mesh, photos, link, talk.complain)
    count = len(project.photo_names)
    if json:
        talk.say_json({"project": str(folder), "photos": project.photo_names})
    else:
        talk.say(f"made {folder} with {mesh.name} and {count} photos")
        talk.say(
            f"next: texproj run {folder}   (or first texproj preview {folder}, to pick points)"
        )
    return DONE


@app.command
def register(
    folder: Folder,
    /,
    *,
    photos: Annotated[str, Parameter(help="Only photos whose name matches, e.g. 'DSC_01*'.")] = "*",
    flags: RegisterFlags = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Find the camera of each photo, where that is not known yet or stale.

    Example: texproj register statue --method points
    """
    from texproj.stages.outcomes import RegisterOutcome  # noqa: PLC0415
    from texproj.stages.registering import register_photos  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "register") as project:
        names = matching(project, photos)
        return run_stage(
            project, json, lambda bench, tell: RegisterOutcome(register_photos(bench, names, tell))
        )


@app.command
def color(
    folder: Folder,
    /,
    *,
    flags: ColorFlags = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Project the registered photos onto the mesh and write the model to out/.

    Example: texproj color statue --to texture
    """
    from texproj.stages.coloring import color_project  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "color") as project:
        return run_stage(project, json, color_project)


@app.command
def refine(
    folder: Folder,
    /,
    *,
    flags: RefineFlags = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Bring all registered cameras to agree with each other on the surface.

    Example: texproj refine statue
    """
    from texproj.stages.refining import refine_project  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "refine") as project:
        return run_stage(project, json, refine_project)


@app.command
def run(
    folder: Folder,
    /,
    *,
    flags: RunFlags = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Register, color and report: whatever is stale of these.

    Example: texproj run statue
    """
    from texproj.stages.running import run_project  # noqa: PLC0415

    with project_at_work(folder, flags, verbose, "run") as project:
        return run_stage(project, json, run_project)


@app.command
def status(folder: Folder, /, *, json: Json = False, verbose: Verbose = False) -> int:
    """Tell for each result whether it is fresh, or stale and which input changed.

    Example: texproj status statue
    """
    from texproj.stages.running import StatusOutcome, project_status  # noqa: PLC0415

    project = open_project(folder, None, verbose)
    return tell(project, StatusOutcome(project_status(project)), json)


@app.command
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


@app.command
def preview(folder: Folder, /, *, flags: PreviewFlags = None, verbose: Verbose = False) -> int:
    """Open the project on a web page of this machine: judge the result, pick points.

    Example: texproj preview statue --port 8765
    """
    from texproj.preview.server import serve  # noqa: PLC0415

    project = open_project(folder, flags, verbose)
    serve(project.root, project.settings.preview)
    return DONE


app.command(import_, name="import")
app.command(export)
app.command(factors)


@app.command
def demo(
    folder: Annotated[
        Path, Parameter(name="DIR", help="The folder to make.", show_default=True)
    ] = Path("texproj-demo"),
    /,
    *,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Make a synthetic project, run it, and say where to look.

    Example: texproj demo
    """
    from texproj.demo import write_demo  # noqa: PLC0415

    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} exists and is not empty; give a new folder")
    if not json:
        talk.say(f"making a carved, painted stone and photographs of it in {folder} ...")
    write_demo(folder)
    code = run(folder, json=json, verbose=verbose)
    if not json:
        talk.say(f"look at {folder / 'out' / 'report.html'}, or run: texproj preview {folder}")
        talk.say(f"the truth to compare with is in {folder / 'truth'}")
    return code


@app.command
def doctor(
    *,
    bundle: Annotated[
        Path | None,
        Parameter(help="A project: also write DIR-report.zip, all that a report of a fault needs."),
    ] = None,
    json: Json = False,
) -> int:
    """Tell what this machine offers, what is missing and how to get it.

    Example: texproj doctor
    """
    from texproj.doctor import examine  # noqa: PLC0415

    findings = examine()
    if bundle is not None:
        return _bundle(bundle, findings, json)
    if json:
        talk.say_json({"findings": [vars(finding) for finding in findings]})
        return DONE
    for finding in findings:
        mark = "ok     " if finding.good else "MISSING"
        talk.say(f"{mark} {finding.name:12} {finding.detail}")
        if finding.remedy:
            talk.say(f"        {'':12} -> {finding.remedy}")
    return DONE


def _bundle(project: Path, findings: Sequence[Any], json: bool) -> int:
    from texproj.bundle import write_bundle  # noqa: PLC0415

    target = Path(f"{project.resolve().name}-report.zip")
    names = write_bundle(project, findings, target)
    if json:
        talk.say_json({"file": str(target), "holds": names})
    else:
        talk.say(f"wrote {target}: {len(names)} files, no photo, no mask, no mesh; look into it")
    return DONE
