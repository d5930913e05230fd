"""The long work that a page can start: the same stages as the command line's."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.exceptions import HTTPException

from texproj.color.weights import names
from texproj.errors import UsageError
from texproj.preview.jobs import Job
from texproj.preview.layers import factor_layers, occlusion_layer, photo_layers, weights_layer
from texproj.preview.picks import SavedPicks
from texproj.preview.session import Session, stamp
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.progress import Cancelled, Progress
from texproj.stages.registering import register_photos

LAYERS = ("ao", "coverage", "source", "weights")
FACTORS = tuple(name for name in names.FACTORS if name != "weight")
"""What a photo's weight is made of; each is a layer too."""
TOGETHER = (("coverage", "source"), FACTORS)
"""Layers that one job makes."""


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
    options = replace(project.settings.register, method="points")
    return project.with_settings(replace(project.settings, register=options))


async def layer_values(session: Session, layer: str, photo: str) -> NDArray[np.float32]:
    """The per-vertex values of a layer; made as a job, kept while nothing changes."""
    if layer not in LAYERS + FACTORS:
        raise HTTPException(404, "no such layer")
    project = session.project
    if layer == "weights" or layer in FACTORS:
        project.photo_path(photo)
    made_with = next((group for group in TOGETHER if layer in group), (layer,))
    key = [made_with, layer != "ao" and stamp(project.cameras_path), session.surface.key, photo]
    made = session.recall(key)
    if made is None:
        try:
            made = await asyncio.wrap_future(_layer_job(session, layer, photo))
        except Cancelled:
            raise HTTPException(409, "stopped on request") from None
        session.keep(key, made)
    return made[layer] if isinstance(made, dict) else made


def _layer_job(session: Session, layer: str, photo: str) -> Any:
    def run(bench: Workbench, progress: Progress) -> Any:
        if layer == "ao":
            return occlusion_layer(bench, progress)
        if layer == "weights":
            return weights_layer(bench, progress, photo)
        if layer in FACTORS:
            return factor_layers(bench, progress, photo)
        return photo_layers(bench, progress)

    return session.start("layer", f"Layer: {layer}", run, photo)[1]


def picks_answer(session: Session, saved: SavedPicks) -> dict[str, Any]:
    """Picks for the page, each with the direction in which the surface looks there."""
    answer = saved.as_dict()
    normals = session.surface.nearest_normals(saved.picks.xyz_in_world)
    for item, normal in zip(answer["picks"], normals, strict=True):
        item["normal"] = normal.tolist()
    return answer
