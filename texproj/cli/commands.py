"""The commands: each opens the project, calls one stage function and tells the outcome."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from cyclopts import App, Parameter

from texproj.cli import talk
from texproj.cli.exchange import export, import_
from texproj.cli.exits import DONE, SOME_FAILED, UNUSABLE
from texproj.cli.flags import flags_for
from texproj.cli.inspecting import factors
from texproj.cli.shared import Folder, Json, Verbose, exit_code, matching, open_project
from texproj.creation import create_project
from texproj.errors import UsageError
from texproj.project import Project
from texproj.settings import SECTIONS
from texproj.version import __version__

app = App(name="texproj", version=__version__, help=__doc__)
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
        talk.say(f"next: texproj preview {folder}   (pick points), then: texproj run {folder}")
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
    from texproj.stages.bench import Workbench  # noqa: PLC0415
    from texproj.stages.registering import register_photos  # noqa: PLC0415

    project = open_project(folder, flags, verbose)
    names = matching(project, photos)
    with Workbench(project) as bench, talk.progress_bars() as progress:
        outcomes = register_photos(bench, names, progress)
    if json:
        talk.say_json({"photos": [_photo_json(o) for o in outcomes]})
    else:
        for outcome in outcomes:
            talk.say(_photo_line(outcome))
    failed = [o for o in outcomes if o.failed]
    return exit_code(len(failed), len(outcomes), "registered")


def _photo_json(outcome: Any) -> dict[str, Any]:
    record = outcome.record
    return {
        "file": outcome.name,
        "status": record.status,
        "method": record.method,
        "kept": outcome.kept,
        "reason": outcome.reason,
        "quality": record.quality,
    }


def _photo_line(outcome: Any) -> str:
    record = outcome.record
    if outcome.failed:
        return f"{outcome.name}: FAILED: {outcome.reason}"
    error = record.quality.get("expected_error_px")
    accuracy = f", expected error {error:.1f} px" if error is not None else ""
    note = f" ({outcome.reason})" if outcome.reason else ""
    kept = "fresh, " if outcome.kept else ""
    return f"{outcome.name}: {kept}{record.status} by {record.method}{accuracy}{note}"


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
    from texproj.stages.bench import Workbench  # noqa: PLC0415
    from texproj.stages.coloring import color_project  # noqa: PLC0415

    project = open_project(folder, flags, verbose)
    with Workbench(project) as bench, talk.progress_bars() as progress:
        outcome = color_project(bench, progress)
    if json:
        talk.say_json({**vars(outcome), "folder": str(project.out)})
    else:
        _say_color(project, outcome)
    return exit_code(len(outcome.failed), len(outcome.failed) + len(outcome.used), "used")


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
    from texproj.stages.bench import Workbench  # noqa: PLC0415
    from texproj.stages.refining import refine_project  # noqa: PLC0415

    project = open_project(folder, flags, verbose)
    with Workbench(project) as bench, talk.progress_bars() as progress:
        outcome = refine_project(bench, progress)
    if json:
        talk.say_json(vars(outcome))
    else:
        _say_refined(outcome)
    total = len(outcome.moved_px) + len(outcome.thrown_out)
    return exit_code(len(outcome.thrown_out), total, "refined")


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
    from texproj.stages.bench import Workbench  # noqa: PLC0415
    from texproj.stages.running import run_project  # noqa: PLC0415

    project = open_project(folder, flags, verbose)
    with Workbench(project) as bench, talk.progress_bars() as progress:
        outcome = run_project(bench, progress)
    if json:
        color = vars(outcome.color) if outcome.color else None
        refined = vars(outcome.refined) if outcome.refined else None
        photos = [_photo_json(o) for o in outcome.photos]
        report = [str(path) for path in outcome.report.files]
        talk.say_json(
            {
                "photos": photos,
                "refine": refined,
                "color": color,
                "report": report,
                "reason": outcome.reason,
                "unrefined": outcome.unrefined,
            }
        )
    else:
        for photo in outcome.photos:
            talk.say(_photo_line(photo))
        if outcome.unrefined:
            names = ", ".join(outcome.unrefined)
            talk.say(f"refinement is switched off: back to their own registration: {names}")
        if outcome.color:
            _say_color(project, outcome.color)
        talk.say(f"report: {outcome.report.files[0]}")
    if outcome.color is None:
        talk.complain(outcome.reason)
        return SOME_FAILED if outcome.failed else UNUSABLE
    return exit_code(len(outcome.failed), len(outcome.photos), "used")


@app.command
def status(folder: Folder, /, *, json: Json = False, verbose: Verbose = False) -> int:
    """Tell for each result whether it is fresh, or stale and which input changed.

    Example: texproj status statue
    """
    from texproj.stages.running import project_status  # noqa: PLC0415

    states = project_status(open_project(folder, None, verbose))
    if json:
        talk.say_json({"items": [vars(state) for state in states]})
        return DONE
    for state in states:
        word = "fresh" if state.fresh else "stale"
        because = f": {state.reason}" if state.reason else ""
        talk.say(f"{state.stage:9} {state.item:24} {word}{because}")
    return DONE


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
    from texproj.stages.bench import Workbench  # noqa: PLC0415
    from texproj.stages.reporting import report_project  # noqa: PLC0415

    project = open_project(folder, flags, verbose)
    with Workbench(project) as bench, talk.progress_bars() as progress:
        outcome = report_project(bench, progress)
    if json:
        talk.say_json({"files": [str(path) for path in outcome.files]})
    else:
        for path in outcome.files:
            talk.say(f"wrote {path}")
    return DONE


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
def doctor(*, json: Json = False) -> int:
    """Tell what this machine offers, what is missing and how to get it.

    Example: texproj doctor
    """
    from texproj.doctor import examine  # noqa: PLC0415

    findings = examine()
    if json:
        talk.say_json({"findings": [vars(finding) for finding in findings]})
        return DONE
    for finding in findings:
        mark = "ok     " if finding.good else "MISSING"
        talk.say(f"{mark} {finding.name:12} {finding.detail}")
        if finding.remedy:
            talk.say(f"        {'':12} -> {finding.remedy}")
    return DONE


def _say_refined(outcome: Any) -> None:
    if outcome.kept:
        talk.say("fresh, kept: nothing has changed since these cameras were refined")
    for name, moved in outcome.moved_px.items() if not outcome.kept else ():
        talk.say(f"{name}: moved by {moved:.2f} px")
    for name in outcome.alone:
        talk.say(f"{name}: stays as it is: no other photo shows enough of the same surface")
    for name, reason in outcome.thrown_out.items():
        talk.say(f"{name}: FAILED: {reason}")


def _say_color(project: Project, outcome: Any) -> None:
    state = "fresh, kept" if outcome.kept else "wrote"
    talk.say(f"{state}: {', '.join(str(project.out / name) for name in outcome.files)}")
    chart = outcome.quality.get("checker")
    if chart:
        before, after = (chart["ciede2000"][when]["median"] for when in ("before", "after"))
        talk.say(
            f"color chart {chart['file']}: CIEDE2000 of its patches {before:.1f} -> {after:.1f};"
            f" exposure: {chart['exposure']}"
        )
    for name, reason in outcome.failed.items():
        talk.say(f"{name}: FAILED: {reason}")
