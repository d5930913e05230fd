"""Pictures of a project for its report: photos with the mesh's edges, the model beside them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2

from texproj.camera import Camera
from texproj.errors import InputError
from texproj.formats.models import read_model
from texproj.mesh import ColoredMesh, TexturedMesh
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.render import ModelLook, model_pictures
from texproj.report.model import packed_model
from texproj.report.page import Pictures, data_url
from texproj.report.pictures import (
    OVERLAY_LONGEST,
    draw_picks,
    encoded,
    marked_hidden,
    on_backdrop,
    overlay,
    viewpoints,
)
from texproj.stages.bench import Workbench
from texproj.stages.coloring import STAGE as COLOR
from texproj.stages.fronts import front
from texproj.stages.kept_pictures import Kept
from texproj.stages.writing import GLB, OBJ, PLY

MOST_COMPARED = 40
"""Photos beside which the model is shown: each is a rendering, and a tenth of a megabyte."""

Model = TexturedMesh | ColoredMesh
Tell = Callable[[int, int, str], None]


def pictures(bench: Workbench, records: dict[str, CameraRecord], tell: Tell) -> Pictures:
    """All that the report shows of the project as it stands; what was drawn before of the same is
    kept. tell: photos done, in all, name.
    """
    names, kept = bench.project.photo_names, Kept.of(bench.project)
    overlays: dict[str, str] = {}
    for done, name in enumerate(names):
        tell(done, len(names), name)
        record = records.get(name)
        picture = kept.photo(name, record, partial(_overlay, bench, name, record))
        if picture is not None:
            overlays[name] = picture
    cameras = {
        name: camera.reduced(OVERLAY_LONGEST)
        for name in overlays
        if (record := records.get(name)) and (camera := record.registered_camera)
    }
    chosen = dict(list(cameras.items())[:MOST_COMPARED])
    shown = kept.model(chosen, records, lambda: _of_model(bench, chosen))
    return Pictures(overlays, shown["models"], shown["views"], shown["packed"])


def _of_model(bench: Workbench, cameras: dict[str, Camera]) -> dict[str, Any]:
    """The model as the photos' cameras see it, from around, and for the page's viewer."""
    model = written_model(bench.project).model
    if model is None:
        return {"models": {}, "views": [], "packed": None}
    before = front(bench.project, bench.mesh)
    beside = model_pictures(bench.renderer, model, cameras.values(), ModelLook(samples=1))
    around = model_pictures(bench.renderer, model, viewpoints(bench.mesh, before))
    return {
        "models": {n: data_url(on_backdrop(p)) for n, p in zip(cameras, beside, strict=True)},
        "views": [data_url(on_backdrop(picture)) for picture in around],
        "packed": packed_model(model, *before),
    }


def _overlay(bench: Workbench, name: str, record: CameraRecord | None) -> str | None:
    """The photo with the mesh's edges, its picks, and what stands in front; None if it cannot be
    read.
    """
    try:
        photo = bench.project.load_photo(name, OVERLAY_LONGEST)
        picks = bench.project.load_correspondences(name)
    except InputError:  # the registration has reported it
        return None
    camera = record.registered_camera if record else None
    if record is None or camera is None:
        return data_url(encoded(photo))
    small = camera.resized(photo.width, photo.height)
    picture = overlay(photo, bench.plain_scene.gbuffer(small, ("depth", "normal")))
    hidden = (bench.project.load_record(COLOR) or {}).get("occluders", {})
    if name in hidden:
        free = cv2.imread(str(bench.project.occluder_path(name)), cv2.IMREAD_GRAYSCALE)
        picture = picture if free is None else marked_hidden(picture, free)
    if picks is not None:
        outliers = [p["name"] for p in record.quality.get("picks", []) if p["outlier"]]
        picture = draw_picks(picture, camera, picks, outliers)
    return data_url(picture)


@dataclass(frozen=True, eq=False)
class Written:
    """The model as it was written, or None if none can be shown; notes: which of its files cannot
    be read, and why.
    """

    model: Model | None
    notes: tuple[str, ...] = ()


def written_model(project: Project) -> Written:
    """The first of the written files that can be read: glb, obj, ply."""
    outputs = (project.load_record(COLOR) or {}).get("outputs", {})
    notes: list[str] = []
    for name in (GLB, OBJ, PLY):
        if name not in outputs or not (project.out / name).is_file():
            continue
        try:
            model = read_model(project.out / name)
        except InputError as error:
            notes.append(f"{error}")
            continue
        notes = [f"{name} is shown, since {why}" for why in notes]
        return Written(model, tuple(notes))
    return Written(None, tuple(notes))
