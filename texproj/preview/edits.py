"""The addresses by which the page changes what a person made: settings, masks, photos left out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from texproj.editing.masks import (
    Stroke,
    draw_on_mask,
    mask_of,
    mask_version,
    steps_back,
    undo_mask,
)
from texproj.editing.toml import change_settings, leave_out, settings_version
from texproj.errors import UsageError
from texproj.preview.door import inside, leaves
from texproj.preview.memory import AXES, remember_up
from texproj.preview.picks import numbers
from texproj.preview.requests import body
from texproj.preview.session import Session
from texproj.preview.settings_form import parse_changes, settings_form
from texproj.project import MASKS_FOLDER, SETTINGS_FILE, Project

SHOWN_PX = 1600
"""Longer side of the masks that the page shows."""

MOST_CORNERS = 5000
MOST_RADIUS_PX = 5000.0
FARTHEST_PX = 2e6
"""A corner further off than ten of the largest photos is no place on one."""
PATHS = ("checker", "gray", "flash")
"""Settings that name a file in the project."""

KINDS = ("paint", "erase", "grow", "clear")


class EditHandlers:
    """One method an address."""

    def __init__(self, session: Session) -> None:
        self.session = session

    def routes(self) -> list[Route]:
        photo = "/api/photos/{name}"
        return [
            Route("/api/settings", self.settings),
            Route("/api/settings", self.change, methods=["PATCH"]),
            Route("/api/up", self.remember_up, methods=["PUT"]),
            Route(f"{photo}/excluded", self.exclude, methods=["PUT"]),
            Route(f"{photo}/mask", self.mask),
            Route(f"{photo}/mask", self.draw, methods=["POST"]),
            Route(f"{photo}/mask/picture", self.mask_picture),
        ]

    def settings(self, _: Request) -> Response:
        return JSONResponse(settings_form(self.session.project))

    async def change(self, request: Request) -> Response:
        data = await body(request)
        changes, base = parse_changes(data.get("changes")), str(data.get("base"))

        def write() -> Response:
            with self.session.edit_lock:
                project = self.session.project
                if settings_version(project) != base:
                    return JSONResponse(settings_form(project), status_code=409)
                self._check_paths(project, changes)
                return JSONResponse(settings_form(change_settings(project, changes)))

        return await run_in_threadpool(write)

    def _check_paths(self, project: Project, changes: Any) -> None:
        """Paths that a setting names stay in the project."""
        inside(project.root / SETTINGS_FILE, project.root)
        for change in changes:
            if change.key in PATHS and isinstance(change.value, str):
                path = project.root / change.value
                if leaves(path, project.root) or not path.is_file():
                    raise UsageError(f"no file {change.value!r} in the project")

    async def remember_up(self, request: Request) -> Response:
        """Which way the model stands on the page; models that are written have `[output] up`."""
        axis = (await body(request)).get("axis")
        if axis not in AXES:
            raise UsageError(f"up is one of {', '.join(AXES)}")
        project = self.session.project
        inside(project.work, self.session.root)
        await run_in_threadpool(remember_up, project, axis)
        return JSONResponse({"up": axis})

    async def exclude(self, request: Request) -> Response:
        data = await body(request)
        name, out = request.path_params["name"], data.get("excluded")
        if not isinstance(out, bool):
            raise UsageError("excluded must be true or false")

        def write() -> Response:
            with self.session.edit_lock:
                project = self.session.project
                if name not in project.photo_paths and name not in project.settings.exclude:
                    raise HTTPException(404, "no such photo")
                inside(project.root / SETTINGS_FILE, project.root)
                leave_out(project, [name], out)
            return JSONResponse({"excluded": out})

        return await run_in_threadpool(write)

    def mask(self, request: Request) -> Response:
        project, name = self._photo(request)
        return JSONResponse(mask_facts(project, name))

    def mask_picture(self, request: Request) -> Response:
        """The mask as a small png: black where the photo is never used."""
        project, name = self._photo(request)
        if project.mask_path(name) is None and not _may_be_transparent(project, name):
            return Response(status_code=204)
        mask = mask_of(project, name)
        factor = min(1.0, SHOWN_PX / max(mask.shape))
        size = tuple(max(1, round(side * factor)) for side in mask.shape[::-1])
        small = cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST_EXACT)
        _, data = cv2.imencode(".png", small)
        return Response(data.tobytes(), media_type="image/png")

    async def draw(self, request: Request) -> Response:
        """One stroke, or a step back."""
        data = await body(request)
        undo = data.get("kind") == "undo"
        stroke, base = None if undo else parse_stroke(data), str(data.get("base"))

        def write() -> Response:
            with self.session.edit_lock:
                project, name = self._photo(request)
                if mask_version(project, name) != base:
                    return JSONResponse(mask_facts(project, name), status_code=409)
                if stroke is None:
                    undo_mask(project, name)
                else:
                    draw_on_mask(project, name, stroke)
                fresh = Project.open(project.root).with_hashes_of(project)
                return JSONResponse(mask_facts(fresh, name))

        return await run_in_threadpool(write)

    def _photo(self, request: Request) -> tuple[Project, str]:
        """The project and a photo of it whose mask may be read and written."""
        project, name = self.session.project, request.path_params["name"]
        if name not in project.photo_paths:
            raise HTTPException(404, "no such photo")
        inside(project.mask_path(name) or project.root / MASKS_FOLDER, self.session.root)
        inside(project.work / "masks", self.session.root)
        return project, name


def mask_facts(project: Project, name: str) -> dict[str, Any]:
    """What the page knows of a mask without looking at it."""
    path = project.mask_path(name)
    return {
        "version": mask_version(project, name),
        "file": path.name if path is not None else None,
        "undo": steps_back(project, name),
    }


def _may_be_transparent(project: Project, name: str) -> bool:
    return Path(project.photo_path(name)).suffix.lower() in (".png", ".tif", ".tiff")


def parse_stroke(data: dict[str, Any]) -> Stroke:
    """A stroke as the page sends it. Raises UsageError for anything else."""
    kind, points = data.get("kind"), data.get("points", [])
    if kind not in KINDS:
        raise UsageError(f"a stroke is one of {', '.join(KINDS)}, undo")
    if not isinstance(points, list) or len(points) > MOST_CORNERS:
        raise UsageError(f"a stroke has at most {MOST_CORNERS} corners")
    if kind in ("paint", "erase") and not points:
        raise UsageError("a stroke needs a corner")
    corners = [numbers(point, 2) for point in points]
    [radius] = numbers([data.get("radius", 0)], 1)
    most = MOST_RADIUS_PX
    if not (math.isfinite(radius) and abs(radius) <= most and (kind == "grow" or radius >= 0)):
        raise UsageError(f"the radius of a stroke is at most {most:g} pixels")
    if any(abs(value) > FARTHEST_PX for corner in corners for value in corner):
        raise UsageError("a corner of the stroke lies far outside of the photo")
    return Stroke(kind, radius, tuple((u, v) for u, v in corners))
