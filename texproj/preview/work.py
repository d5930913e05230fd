"""The long work that a page can start: the same stages as the command line's."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.exceptions import HTTPException

from texproj.color.weights import names
from texproj.errors import UsageError, excerpt
from texproj.preview.jobs import Job
from texproj.preview.layers import (
    factor_layers,
    mean_layer,
    occlusion_layer,
    photo_layers,
    weights_layer,
)
from texproj.preview.picks import SavedPicks
from texproj.preview.session import Session, stamp
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.choosing import NONE_OF_THEM, choose, open_question
from texproj.stages.methods import AUTO
from texproj.stages.progress import Cancelled, Progress
from texproj.stages.registering import register_photos

LAYERS = ("ao", "coverage", "source", "weights")
FACTORS = tuple(name for name in names.FACTORS if name != "weight")
"""What a photo's weight is made of; each is a layer too."""
TOGETHER = (("coverage", "source"), FACTORS)
"""Layers that one job makes."""


def start(session: Session, data: Mapping[str, Any]) -> Job:
    """Queue one of: solve (one photo from its picks), place (all photos where somebody said),
    register, color, run. Raises UsageError.
    """
    kind = data.get("kind")
    if kind == "place":
        return _start_place(session, data.get("place"))
    if kind == "solve":
        photo = data.get("photo")
        name = photo if isinstance(photo, str) else ""
        session.project.photo_path(name)

        def solve(bench: Workbench, progress: Progress) -> str:
            return _solve(bench, name, progress)

        return session.start(kind, f"Solve {name}", solve, name)[0]
    if not isinstance(kind, str) or kind not in STAGES:
        known = ", ".join(["solve", "place", *STAGES])
        raise UsageError(f"unknown work {excerpt(kind)} (known: {known})")
    title, stage = STAGES[kind]
    return session.start(kind, title, stage)[0]


def _start_place(session: Session, number: Any) -> Job:
    """Queue saying which of several places is right, and all that follows from it."""
    if number is not None and type(number) is not int:
        raise UsageError("a place is a number, or null where nobody knows")

    def place(bench: Workbench, progress: Progress) -> str:
        choose(bench.project, number)
        if number is None:
            return "Choose again."
        if number == NONE_OF_THEM:
            return "None of the places is right. Pick 8 points in one photo."
        return _run(bench, progress)

    title = "Make the model" if number else "Choose the place"
    return session.start("place", title, place, str(number))[0]


def _solve(bench: Workbench, name: str, progress: Progress) -> str:
    """One photo from its picks, and as Register would go on from there. A camera from elsewhere,
    which that would keep, is sought by the picks first.
    """
    before = bench.project.load_cameras().get(name)
    elsewhere = before is not None and not before.sought and before.status == "registered"
    for method in ("points", AUTO) if elsewhere else (AUTO,):
        bench.project = with_method(bench.project, method)
        [outcome] = register_photos(bench, [name], progress)
        if not outcome.failed:
            return f"{name} is registered."
    return f"{name} is not registered: {outcome.reason.removeprefix(f'{name}: ')}"


def _register(bench: Workbench, progress: Progress) -> str:
    outcomes = register_photos(bench, progress=progress)
    found = sum(not outcome.failed for outcome in outcomes)
    return f"{found} of {len(outcomes)} photos are registered.{_question(bench)}"


def _question(bench: Workbench) -> str:
    """What the page asks, after what came of the work; empty if nothing."""
    question = open_question(bench.project)
    return f" {len(question.photos)} fit in several places: choose one below." if question else ""


def _color(bench: Workbench, progress: Progress) -> str:
    from texproj.stages.coloring import color_project  # noqa: PLC0415 - slow to import

    color_project(bench, progress)
    return "The model is colored."


def _run(bench: Workbench, progress: Progress) -> str:
    from texproj.stages.running import run_project  # noqa: PLC0415 - slow to import

    outcome = run_project(bench, progress)
    if outcome.color is None:
        return f"No model: {outcome.reason}.{_question(bench)}"
    used = len(outcome.photos) - len(outcome.failed)
    left = f"; not used: {', '.join(outcome.failed)}" if outcome.failed else ""
    return f"The model is made from {used} of {len(outcome.photos)} photos{left}.{_question(bench)}"


def _appearance(bench: Workbench, progress: Progress) -> str:
    from texproj.stages.appearing import appearance_project  # noqa: PLC0415 - slow to import

    light = appearance_project(bench, progress).light
    if not light["accepted"]:
        return f"The light was not taken out: {light['reason']}"
    return "The light of the photos is taken out."


def _turntable(bench: Workbench, progress: Progress) -> str:
    from texproj.stages.turning import TurntableOptions, turn_project  # noqa: PLC0415

    notes = turn_project(bench, TurntableOptions(), progress).notes
    return "; ".join(["The film is made: download it under Model", *notes]) + "."


STAGES = {
    "appearance": ("Take out the light", _appearance),
    "turntable": ("Film the model", _turntable),
    "register": ("Register photos", _register),
    "color": ("Color model", _color),
    "run": ("Make the model", _run),
}
"""Title and function of each stage that works on the whole project."""


def with_method(project: Project, method: Any) -> Project:
    """The project with the settings that register by one method."""
    options = replace(project.settings.register, method=method)
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
            job = _layer_job(session, layer, photo, made_with)
            made = await asyncio.shield(asyncio.wrap_future(job))  # others may wait for it, too
        except Cancelled:
            raise HTTPException(409, "stopped on request") from None
        session.keep(key, made)
    return made[layer] if isinstance(made, dict) else made


async def mean_colors(session: Session) -> NDArray[np.uint8]:
    """(V, 4) the plain mean of the photos on each vertex; made as a job, kept for a while."""
    key = ["mean", stamp(session.project.cameras_path), session.surface.key]
    made = session.recall(key)
    if made is None:
        try:
            job = session.start("layer", "Averaging the photos", mean_layer, "mean", looks=True)[1]
            made = await asyncio.shield(asyncio.wrap_future(job))
        except Cancelled:
            raise HTTPException(409, "stopped on request") from None
        session.keep(key, made)
    return np.asarray(made)


def _layer_job(session: Session, layer: str, photo: str, made_with: tuple[str, ...]) -> Any:
    def run(bench: Workbench, progress: Progress) -> Any:
        if layer == "ao":
            return occlusion_layer(bench, progress)
        if layer == "weights":
            return weights_layer(bench, progress, photo)
        if layer in FACTORS:
            return factor_layers(bench, progress, photo)
        return photo_layers(bench, progress)

    title = LAYER_TITLES.get(layer, "Measuring what a photo counts for")
    return session.start("layer", title, run, f"{'+'.join(made_with)} {photo}", looks=True)[1]


LAYER_TITLES = {
    "ao": "Measuring how open the surface is",
    "coverage": "Counting the photos that see the surface",
    "source": "Finding the photo that counts most",
}


def picks_answer(session: Session, saved: SavedPicks) -> dict[str, Any]:
    """Picks for the page, each with the direction in which the surface looks there."""
    answer = saved.as_dict()
    normals = session.surface.nearest_normals(saved.picks.xyz_in_world)
    for item, normal in zip(answer["picks"], normals, strict=True):
        item["normal"] = normal.tolist()
    return answer
