"""The server's addresses: what the page asks and how it is answered."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from watchfiles import awatch

from texproj.errors import InputError, TexprojError, UsageError
from texproj.formats.meshes.gltf_compressed import DRACO
from texproj.formats.models.binary import required_extensions
from texproj.preview import work
from texproj.preview.colors import (
    MATERIAL,
    base_colors,
    material_values,
    texture_colors,
    vertex_colors,
)
from texproj.preview.door import inside
from texproj.preview.downloads import DownloadHandlers, downloads
from texproj.preview.edits import EditHandlers
from texproj.preview.geometry import pack
from texproj.preview.jobs import TooManyJobs
from texproj.preview.materials import material_table
from texproj.preview.photos import SIZES
from texproj.preview.picking import (
    MATCH_LONGEST,
    fit_picks,
    parse_camera,
    predict_on_model,
    predict_on_photo,
)
from texproj.preview.picks import (
    VersionConflict,
    load_picks,
    numbers,
    parse_names,
    parse_picks,
    save_picks,
)
from texproj.preview.places import places_facts
from texproj.preview.plain_model import plain_glb
from texproj.preview.proposals import SURE, Guess, proposals
from texproj.preview.requests import body
from texproj.preview.security import BodyTooLong, refuse
from texproj.preview.session import MODEL_FILES, Session, shown, stamp
from texproj.stages.appearance_files import MATERIALS
from texproj.stages.attending import INTERNAL
from texproj.stages.partners import partners

LOG = logging.getLogger("texproj.preview")
BINARY = "application/octet-stream"
BUNDLE = {
    "app.js": "text/javascript; charset=utf-8",
    "app.css": "text/css; charset=utf-8",
    "index.html": "text/html; charset=utf-8",
    "icon.svg": "image/svg+xml",
}
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; img-src data: blob:; connect-src data: blob:;"
    " style-src 'unsafe-inline'; script-src 'unsafe-inline'"
)
"""The report is one file with all that it needs in it, and may read nothing else."""

MOST_PARTNERS = 12
NEWS_PAUSE_MS = 200
"""Changes of files are told together for so long: a stage writes several at once."""


def bundle_folder() -> Path:
    """Where the built page is. Raises InputError if it was not built."""
    folder = Path(str(files("texproj.preview"))) / "static" / "bundle"
    if not (folder / "index.html").is_file():
        raise InputError(f"the page is not built ({folder} is missing); run `pip install .`")
    return folder


def create_app(session: Session) -> Starlette:
    """The application for one project. Raises InputError if the page was not built."""
    folder = bundle_folder()
    handlers = Handlers(session, folder)

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        watcher = asyncio.create_task(watch(session))
        session.warm_up()
        yield
        watcher.cancel()
        session.close()

    errors: dict[Any, Any] = {
        TexprojError: on_texproj_error,
        BodyTooLong: on_long_body,
        HTTPException: on_http_error,
        Exception: on_fault,
    }
    more = [*EditHandlers(session).routes(), *DownloadHandlers(session).routes()]
    routes = [*handlers.routes(), *more]
    app = Starlette(routes=routes, lifespan=lifespan, exception_handlers=errors)
    app.state.session = session
    return app


class Handlers:
    """One method an address."""

    def __init__(self, session: Session, bundle: Path) -> None:
        self.session = session
        self.bundle = bundle

    def routes(self) -> list[Route]:
        """All addresses."""
        photo = "/api/photos/{name}"
        return [
            Route("/", self.page),
            Route("/static/{name}", self.static),
            Route("/api/project", self.project),
            Route("/api/events", self.events),
            Route("/api/mesh/{level}", self.mesh),
            Route("/api/colors", self.colors),
            Route("/api/colors/light", self.light_colors),
            Route("/api/colors/base", self.base_colors),
            Route("/api/lights", self.lights),
            Route("/api/materials", self.materials),
            Route("/api/colors/mean", self.mean_colors),
            Route("/api/layers/{layer}", self.layer),
            Route("/api/models/{name}", self.model),
            Route("/report", self.report),
            Route("/api/hit", self.hit, methods=["POST"]),
            Route("/api/places", self.places),
            Route("/api/jobs", self.start_job, methods=["POST"]),
            Route("/api/jobs/{number:int}", self.cancel_job, methods=["DELETE"]),
            Route(f"{photo}/image", self.image),
            Route(f"{photo}/partners", self.partners),
            Route(f"{photo}/picks", self.picks),
            Route(f"{photo}/picks", self.save, methods=["PUT"]),
            Route(f"{photo}/fit", self.fit, methods=["POST"]),
            Route(f"{photo}/predict", self.predict, methods=["POST"]),
            Route(f"{photo}/proposals", self.propose, methods=["POST"]),
        ]

    def page(self, _: Request) -> Response:
        return self.bundled("index.html")

    def static(self, request: Request) -> Response:
        return self.bundled(request.path_params["name"])

    def bundled(self, name: str) -> Response:
        """One of the few files of the page."""
        if name not in BUNDLE:
            raise HTTPException(404, "no such file")
        headers = {"cache-control": "no-cache"}
        return FileResponse(self.bundle / name, media_type=BUNDLE[name], headers=headers)

    def project(self, _: Request) -> Response:
        facts = self.session.facts()
        return JSONResponse({**facts, "downloads": downloads(self.session.project)})

    def places(self, _: Request) -> Response:
        inside(self.session.project.work / "block", self.session.root)
        return JSONResponse(places_facts(self.session))

    async def events(self, _: Request) -> Response:
        hello = {"jobs": [job.as_dict() for job in self.session.jobs.active]}
        return StreamingResponse(self.session.hub.stream(hello), media_type="text/event-stream")

    def mesh(self, request: Request) -> Response:
        level = request.path_params["level"]
        if level not in ("first", "full", "light"):
            raise HTTPException(404, "no such level of detail")
        data = getattr(self.session.surface, f"{level}_pack")
        return Response(data or b"", 200 if data else 204, media_type=BINARY)

    def colors(self, _: Request) -> Response:
        inside(self.session.project.out / "model.ply", self.session.root)
        rgba = vertex_colors(self.session.project, self.session.surface)
        return Response(pack({"rgba": rgba}), media_type=BINARY)

    def light_colors(self, _: Request) -> Response:
        project, surface = self.session.project, self.session.surface
        inside(project.out / "model.glb", self.session.root)
        key = ["light colors", surface.key, stamp(project.out / "model.glb")]
        rgba = self.session.kept(key, lambda: texture_colors(project, surface))
        return Response(pack({"rgba": rgba}), media_type=BINARY)

    def base_colors(self, _: Request) -> Response:
        """The surface without the light of the photos."""
        inside(self.session.project.out / "appearance.ply", self.session.root)
        rgba = base_colors(self.session.project, self.session.surface)
        return Response(pack({"rgba": rgba}), media_type=BINARY)

    def lights(self, _: Request) -> Response:
        from texproj.preview.lights import lights  # noqa: PLC0415 - slow to import

        inside(self.session.project.out / "light.json", self.session.root)
        return JSONResponse(lights(self.session.project, self.session.surface))

    def materials(self, _: Request) -> Response:
        """What the surface is made of, where `appearance` tells it."""
        inside(self.session.project.out / MATERIALS, self.session.root)
        return JSONResponse(material_table(self.session.project))

    async def mean_colors(self, _: Request) -> Response:
        """The plain mean of all photos on the vertices: doubled edges show what is off."""
        return Response(pack({"rgba": await work.mean_colors(self.session)}), media_type=BINARY)

    async def layer(self, request: Request) -> Response:
        name, photo = request.path_params["layer"], request.query_params.get("photo", "")
        if name in MATERIAL:
            return await run_in_threadpool(self.material, name)
        values = await work.layer_values(self.session, name, photo)
        return Response(pack({"values": values}), media_type=BINARY)

    def material(self, name: str) -> Response:
        project, surface = self.session.project, self.session.surface
        inside(project.out / "appearance.ply", self.session.root)
        values = material_values(project, surface, name)
        return Response(pack({"values": values}), media_type=BINARY)

    def model(self, request: Request) -> Response:
        name = request.path_params["name"]
        path = self.session.project.out / name
        if name not in MODEL_FILES or not path.is_file():
            raise HTTPException(404, "no such model")
        inside(path, self.session.root)
        if DRACO in required_extensions(path):
            return Response(plain_glb(path), media_type=MODEL_FILES[name])
        return FileResponse(path, media_type=MODEL_FILES[name])

    def report(self, _: Request) -> Response:
        """The report as it was written, without any right to ask this server for anything."""
        path = self.session.project.out / "report.html"
        if not path.is_file():
            raise HTTPException(404, "no report yet")
        inside(path, self.session.root)
        headers = {"content-security-policy": REPORT_POLICY}
        return FileResponse(path, media_type="text/html; charset=utf-8", headers=headers)

    def partners(self, request: Request) -> Response:
        """The photos that show the same as one, most of it first."""
        project, name = self.photo_of(request)
        found = [other.name for other in partners(project, name) if other.matches]
        return JSONResponse({"photos": found[:MOST_PARTNERS]})

    async def hit(self, request: Request) -> Response:
        data = await body(request)
        origin = np.array(numbers(data.get("origin"), 3))
        direction = np.array(numbers(data.get("direction"), 3))
        if not np.linalg.norm(direction) > 0:
            raise UsageError("a direction cannot be zero")
        found = await run_in_threadpool(lambda: self.session.surface.hit(origin, direction))
        return JSONResponse(found.as_dict() if found else None)

    async def start_job(self, request: Request) -> Response:
        data = await body(request)
        job = work.start(self.session, data)
        return JSONResponse(job.as_dict(), status_code=202)

    def cancel_job(self, request: Request) -> Response:
        if not self.session.jobs.cancel(request.path_params["number"]):
            raise HTTPException(404, "there is no such job any more")
        return JSONResponse({"cancelled": True}, status_code=202)

    def image(self, request: Request) -> Response:
        name, project = request.path_params["name"], self.session.project
        size = request.query_params.get("size", str(SIZES[0]))
        if name not in project.photo_paths or size not in map(str, SIZES):
            raise HTTPException(404, "no such picture")
        data = self.session.pictures.jpeg(project, name, int(size))
        return Response(data, media_type="image/jpeg")

    def picks(self, request: Request) -> Response:
        project, name = self.photo_of(request)
        return JSONResponse(work.picks_answer(self.session, load_picks(project, name)))

    async def save(self, request: Request) -> Response:
        data = await body(request)
        project, name = self.photo_of(request)
        picks, base = parse_picks(data.get("picks")), str(data.get("base"))

        def write() -> Response:
            with self.session.edit_lock:
                try:
                    saved, status = save_picks(project, name, picks, base), 200
                except VersionConflict:
                    saved, status = load_picks(project, name), 409
            answer = work.picks_answer(self.session, saved)
            return JSONResponse(answer, status_code=status)

        return await run_in_threadpool(write)

    async def fit(self, request: Request) -> Response:
        data = await body(request)
        project, name = self.photo_of(request)
        picks, without = parse_picks(data.get("picks")), parse_names(data.get("without", []))
        return JSONResponse(await run_in_threadpool(fit_picks, project, name, picks, without))

    async def predict(self, request: Request) -> Response:
        data = await body(request)
        project, name = self.photo_of(request)
        camera, surface = parse_camera(data.get("camera")), self.session.surface
        on_model = "uv" in data
        given = np.array(numbers(data.get("uv" if on_model else "xyz"), 2 if on_model else 3))
        find = predict_on_model if on_model else predict_on_photo

        def run() -> dict[str, Any] | None:
            found = find(surface, self.photo_to_match(project, name), camera, given)
            return found.as_dict() if found else None

        return JSONResponse(await run_in_threadpool(run))

    async def propose(self, request: Request) -> Response:
        data = await body(request)
        project, name = self.photo_of(request)
        [error_px] = numbers([data.get("error_px")], 1)
        guess = Guess(parse_camera(data.get("camera")), SURE * abs(error_px))
        own = parse_picks(data.get("picks")).xyz_in_world
        surface = self.session.surface

        def run() -> list[dict[str, Any]]:
            return proposals(project, surface, self.photo_to_match(project, name), guess, own)

        return JSONResponse(await run_in_threadpool(run))

    def photo_to_match(self, project: Any, name: str) -> Any:
        """The reduced photo in which matches are sought."""
        key = ["gray", name, project.hash_of(project.photo_path(name))]
        return self.session.kept(key, lambda: project.load_photo(name, MATCH_LONGEST))

    def photo_of(self, request: Request) -> tuple[Any, str]:
        """The project and the photo that an address names; only photos of the project exist."""
        project, name = self.session.project, request.path_params["name"]
        if name not in project.photo_paths:
            raise HTTPException(404, "no such photo")
        inside(project.correspondences_path(name), self.session.root)
        return project, name


async def watch(session: Session, force_polling: bool | None = None) -> None:
    """Tell the pages what changed in the folder, whoever did it."""
    root = session.root.resolve()
    folders = {root, (root / session.project.settings.photos).resolve()}
    news = awatch(
        *(folder for folder in folders if folder.is_dir()),
        watch_filter=lambda _, path: shown(path, root) is not None,
        debounce=NEWS_PAUSE_MS, step=NEWS_PAUSE_MS // 4, force_polling=force_polling,
    )  # fmt: skip
    try:
        async for changes in news:
            paths = sorted({shown(path, root) or "" for _, path in changes})
            session.hub.send("files", {"changed": paths[:200]})
    except OSError as error:  # the system watches no more folders
        LOG.warning("looking for changes of files every now and then: %s", error)
        await watch(session, force_polling=True)


def on_texproj_error(_: Request, error: Exception) -> Response:
    """What a person can mend, in the sentence that the command line would print."""
    if isinstance(error, TooManyJobs):
        return refuse(429, str(error))
    return refuse(400 if isinstance(error, UsageError) else 422, str(error))


def on_fault(request: Request, error: Exception) -> Response:
    """What nobody foresaw: told to the page, with its traceback in the log."""
    request.app.state.session.log_fault(f"{request.method} {request.url.path}", error)
    return refuse(500, INTERNAL)


def on_long_body(_: Request, __: Exception) -> Response:
    """Too much was sent."""
    return refuse(413, "the request is too long")


def on_http_error(_: Request, error: Exception) -> Response:
    """Anything else that is refused."""
    assert isinstance(error, HTTPException)
    return refuse(error.status_code, error.detail)
