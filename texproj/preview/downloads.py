"""What was made, to be taken away from the page."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from starlette.background import BackgroundTask
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from texproj.preview.door import inside, leaves
from texproj.preview.session import Session
from texproj.project import Project
from texproj.stages.turning import STAGE as TURNTABLE

OBJ, FILM = "model.obj", f"{TURNTABLE}.webp"
PARTS = ("model.obj", "model.mtl", "model_[0-9]*.*")
"""Files that make up an obj."""
ZIP_LEVEL = 1
"""Text of numbers is not much smaller by more work."""
FILES = {
    "model.glb": ("glb", "model/gltf-binary", ".glb"),
    OBJ: ("obj", "application/zip", "-obj.zip"),
    "model.ply": ("ply", "application/octet-stream", ".ply"),
    "model.usdz": ("usdz", "model/vnd.usdz+zip", ".usdz"),
    "appearance.glb": ("base color", "model/gltf-binary", "-base-color.glb"),
    FILM: ("film", "image/webp", ".webp"),
}
"""Of each file in out/: what it is called on the page, its type, and the end of the name under
which it is saved."""


class DownloadHandlers:
    """One method an address."""

    def __init__(self, session: Session) -> None:
        self.session = session

    def routes(self) -> list[Route]:
        return [Route("/api/downloads/{name}", self.download)]

    def download(self, request: Request) -> Response:
        name, project = request.path_params["name"], self.session.project
        path = project.out / name
        if name not in FILES or not path.is_file():
            raise HTTPException(404, "no such file")
        inside(path, self.session.root)
        _, kind, ending = FILES[name]
        saved = project.root.resolve().name + ending
        if name != OBJ:
            return FileResponse(path, media_type=kind, filename=saved)
        packed = _packed([part for part in _parts(project) if not leaves(part, self.session.root)])
        gone = BackgroundTask(packed.unlink)
        return FileResponse(packed, media_type=kind, filename=saved, background=gone)


def downloads(project: Project) -> list[dict[str, Any]]:
    """The files that there are, each with the word for it. A film of an earlier model is none."""
    there = [name for name in FILES if (project.out / name).is_file()]
    made = [_time(project.out / name) for name in there if name.startswith("model.")]
    old = FILM in there and any(time > _time(project.out / FILM) for time in made)
    return [
        {"name": name, "word": FILES[name][0]} for name in there if not (old and name == FILM)
    ]  # fmt: skip


def _time(path: Path) -> float:
    return path.stat().st_mtime


def _parts(project: Project) -> Iterator[Path]:
    for pattern in PARTS:
        yield from sorted(project.out.glob(pattern))


def _packed(parts: list[Path]) -> Path:
    """The files in one, outside of the project; whoever asked for it removes it."""
    with tempfile.NamedTemporaryFile(prefix="texproj-obj-", suffix=".zip", delete=False) as made:
        with zipfile.ZipFile(made, "w") as packed:
            for part in parts:
                text = part.suffix in (".obj", ".mtl")
                how = zipfile.ZIP_DEFLATED if text else zipfile.ZIP_STORED
                packed.write(part, part.name, how, ZIP_LEVEL)
        return Path(made.name)
