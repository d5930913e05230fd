"""The long work that a page can start: the same stages as the command line's."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.exceptions import HTTPException

from texproj.errors import UsageError
from texproj.preview.jobs import Job
from texproj.preview.layers import occlusion_layer, photo_layers, weights_layer
from texproj.preview.picks import SavedPicks
from texproj.preview.session import Session, stamp
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.progress import Cancelled, Progress
from texproj.stages.registering import register_photos

LAYERS = ("ao", "coverage", "source", "weights")


def start(session: Session, kind: Any, photo: Any) -> Job:
    """Queue one of: solve (one photo from its picks), register, color, run. Raises UsageError."""
    project = session.project
    if kind == "solve":
        name = str(photo)
        project.photo_path(name)

        def solve(bench: Workbench, progress: Progress) -> Any:
            return register_photos(bench, [name], progress)

        return session.start(kind, f"Solve {name}", solve, name, by_points(project))[0]
    if kind not in STAGES:
        raise UsageError(f"unknown work {kind!r} (known: solve, {', '.join(STAGES)})")
    title, stage = STAGES[kind]
    return session.start(kind, title, stage)[0]


def _register(bench: Workbench, progress: Progress) -> Any:
    return register_photos(bench, progress=progress)


def _color(bench: Workbench, progress: Progress) -> Any:
    from texproj.stages.coloring import color_project  # noqa: PLC0415 - slow to import

    return color_project(bench, progress)


def _run(bench: Workbench, progress: Progress) -> Any:
    from texproj.stages.running import run_project  # noqa: PLC0415 - slow to import

    return run_project(bench, progress)


STAGES = {
    "register": ("Register photos", _register),
    "color": ("Color the model", _color),
    "run": ("Run", _run),
}
"""Title and function of each stage that works on the whole project."""


def by_points(project: Project) -> Project:
    """The project with the settings that register from picks."""
    options = replace(project.settings.options("register"), method="points")
    return project.with_settings(project.settings.with_options("register", options))


async def layer_values(session: Session, layer: str, photo: str) -> NDArray[np.float32]:
    """The per-vertex values of a layer; made as a job, kept while nothing changes."""
    if layer not in LAYERS:
        raise HTTPException(404, "no such layer")
    project = session.project
    if layer == "weights":
        project.photo_path(photo)
    many = layer in ("coverage", "source")
    key = [layer != "ao" and stamp(project.cameras_path), session.surface.key, photo]
    known = session.recall([layer, *key])
    if known is not None:
        return known
    try:
        made = await asyncio.wrap_future(_layer_job(session, layer, photo))
    except Cancelled:
        raise HTTPException(409, "stopped on request") from None
    for name, values in (made if many else {layer: made}).items():
        session.keep([name, *key], values)
    return session.recall([layer, *key])


def _layer_job(session: Session, layer: str, photo: str) -> Any:
    def run(bench: Workbench, progress: Progress) -> Any:
        if layer == "ao":
            return occlusion_layer(bench, progress)
        if layer == "weights":
            return weights_layer(bench, progress, photo)
        return photo_layers(bench, progress)

    return session.start("layer", f"Layer: {layer}", run, photo)[1]


def picks_answer(session: Session, saved: SavedPicks) -> dict[str, Any]:
    """Picks for the page, each with the direction in which the surface looks there."""
    answer = saved.as_dict()
    normals = session.surface.nearest_normals(saved.picks.xyz_in_world)
    for item, normal in zip(answer["picks"], normals, strict=True):
        item["normal"] = normal.tolist()
    return answer
