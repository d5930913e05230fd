"""The commands that make a project."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from texproj.cli import talk
from texproj.cli.exits import DONE
from texproj.cli.making import run
from texproj.cli.shared import Json, Verbose
from texproj.creation import create_project, write_settings
from texproj.errors import UsageError
from texproj.options import DemoLight


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


def demo(
    folder: Annotated[
        Path, Parameter(name="DIR", help="The folder to make.", show_default=True)
    ] = Path("texproj-demo"),
    /,
    *,
    light: Annotated[
        DemoLight | None,
        Parameter(help="A piece whose light is found and taken out; its cameras are given."),
    ] = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Make a synthetic project, run it, and say where to look.

    Example: texproj demo

    Example: texproj demo lit --light turntable
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} exists and is not empty; give a new folder")
    _make(folder, light, json)
    code = run(folder, json=json, verbose=verbose)
    if not json:
        talk.say(f"look at {folder / 'out' / 'report.html'}, or run: texproj preview {folder}")
        if light is not None:
            talk.say(f"and in another light: texproj relight {folder} --sun 85,10 --sky none")
        talk.say(f"the truth to compare with is in {folder / 'truth'}")
    return code


def _make(folder: Path, light: DemoLight | None, json: bool) -> None:
    """Write the project."""
    from texproj.demo import write_demo, write_lit_demo  # noqa: PLC0415
    from texproj.demo.lamps import light_settings  # noqa: PLC0415

    if not json:
        what = "shrine" if light is None else f"capital ({light})"
        talk.say(f"making a carved, painted {what} and photographs of it in {folder} ...")
    if light is None:
        write_demo(folder)
        write_settings(folder, "scan.ply")
    else:
        write_lit_demo(folder, light)
        write_settings(folder, "scan.ply", light_settings(light))
