"""Stage `appearance`: the light of the photos found and taken out of the colors."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from texproj.errors import InputError
from texproj.files import staging
from texproj.formats.models import write_colored_glb, write_pages, write_ply
from texproj.mesh import ColoredMesh, MeshSource, vertex_normals
from texproj.options import ColorOptions, OutputOptions
from texproj.photo import srgb_from_linear
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.checking import checker_of
from texproj.stages.coloring import (
    changed_outputs,
    photo_set,
    remove_leftovers,
    seen_inputs,
    usable_cameras,
)
from texproj.stages.freshness import Freshness, Inputs, changed_inputs, options_inputs
from texproj.stages.occluding import keep_occluders
from texproj.stages.outcomes import Tally
from texproj.stages.progress import Progress, silent
from texproj.stages.provenance import provenance_of
from texproj.stages.writing import OutputPlan, output_plan, write_texture

if TYPE_CHECKING:
    from texproj.appearance.natural import Chart
    from texproj.appearance.recovered import Appearance
    from texproj.color.result import Texture, VertexColors

STAGE = "appearance"
VERSION = 1
PLY, GLB, LIGHT = "appearance.ply", "appearance.glb", "light.json"
BASE = "base_color"
SECTIONS = ("color", "unwrap", "light", "output", "render")
Target = Literal["vertices", "texture"]

HIGHLIGHT = 1.0
"""How strongly highlights are distrusted: they are none of the surface's color."""

MATTE = 1.0
"""Roughness that is written: natural light tells none."""


@dataclass(frozen=True, eq=False)
class AppearanceOutcome:
    """What was written; light: what light.json says; kept: nothing had changed since."""

    folder: Path
    files: tuple[str, ...]
    used: tuple[str, ...]
    failed: dict[str, str]
    light: dict[str, Any]
    kept: bool

    @property
    def tally(self) -> Tally:
        return Tally(len(self.failed), len(self.failed) + len(self.used), "used")

    def lines(self) -> Iterator[str]:
        """For people."""
        state = "fresh, kept" if self.kept else "wrote"
        yield f"{state}: {', '.join(str(self.folder / name) for name in self.files)}"
        yield from light_lines(self.light)
        for name, reason in self.failed.items():
            yield f"{name}: FAILED: {reason}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {**vars(self), "folder": str(self.folder)}


def light_lines(light: dict[str, Any]) -> Iterator[str]:
    """What was found of the light, for people."""
    if not light["accepted"]:
        yield f"refused, the base color is that of the photos: {light['reason']}"
        return
    sun = light["sun"]
    if sun is None:
        yield "light: a sky, no sun"
    else:
        x, y, z = sun
        yield f"light: a sky and a sun towards ({x:.2f}, {y:.2f}, {z:.2f})"
    told = light["verdict"]
    yield (
        f"parts of the surface left out of the fit: {told['lit_db']:.1f} dB with the light,"
        f" {told['plain_db']:.1f} dB without"
    )
    known = "reflectance" if light["absolute"] else "known up to a factor; a color chart fixes it"
    yield f"base color: {known}"


def appearance_project(
    bench: Workbench, progress: Progress = silent, to: Target | None = None
) -> AppearanceOutcome:
    """Find the light of the registered photos and write the surface without it to out/.

    to: "texture" writes a textured model too, in place of that of the stage `color`; None = as the
    last time. A photo that cannot be read is left out and named in `failed`. Raises InputError if
    none is left, OutputError if out/ cannot be written; the old files stay then.
    """
    project = bench.project
    before = project.load_record(STAGE)
    to = to or _made(before)
    if before is not None and appearance_freshness(project, to).fresh:
        return _outcome(project, before, kept=True)
    _check_chart(project)
    cameras, failed = usable_cameras(project)
    keep_occluders(bench, cameras, progress)
    inputs = _inputs(project, to)
    plan = output_plan(*_wanted(project), tuple(cameras.values()))
    colors, appearance = _found(bench, progress)
    failed |= colors.failed
    if not set(cameras) - set(failed):
        raise InputError(f"no photo could be read: {'; '.join(failed.values())}")
    light = light_facts(appearance)
    used = [name for name in cameras if name not in failed]
    plan = replace(plan, provenance=provenance_of(project, used))
    with staging(project.out) as folder:
        files = _write(folder, bench.source, appearance, plan)
        if to == "texture":
            texture = _texture(bench, appearance, progress)
            files += _write_texture(folder, bench, texture, plan)
        (folder / LIGHT).write_text(json.dumps(light, indent=1), encoding="utf-8")
    files = (*files, LIGHT)
    remove_leftovers(project, before, files)
    record = {
        "inputs": inputs,
        "outputs": {name: project.hash_of(project.out / name) for name in files},
        "used": used,
        "failed": failed,
        "light": light,
        "to": to,
    }
    project.save_record(STAGE, None, record)
    project.save_hashes()
    return _outcome(project, record, kept=False)


def _found(bench: Workbench, progress: Progress) -> tuple[VertexColors, Appearance]:
    """What the photos show at the vertices, and what of that is the surface's own."""
    from texproj.appearance.natural import natural_appearance  # noqa: PLC0415 - slow to load
    from texproj.color.vertices import color_vertices  # noqa: PLC0415

    project = _with_chart(bench.project)
    photos = photo_set(project, usable_cameras(project)[0])

    def tell(done: int, total: int) -> None:
        progress("color", done, total, "")

    def tell_more(done: int, total: int) -> None:
        progress(STAGE, done, total, "")

    options, checker = _blending(project.settings.color, "vertices"), checker_of(project)
    colors = color_vertices(bench.mesh, photos, bench.renderer, options, checker, tell)
    told = colors.quality.get("checker")
    chart: Chart = "none" if told is None else "scale" if told["exposure_known"] else "tint"
    seen = colors.weight > 0
    return colors, natural_appearance(bench.mesh, colors.rgb, seen, chart, tell_more)


def _texture(bench: Workbench, appearance: Appearance, progress: Progress) -> Texture:
    """The texture of base colors."""
    from texproj.appearance.texels import base_texture  # noqa: PLC0415 - slow to load
    from texproj.color.texture import color_texture  # noqa: PLC0415

    project = _with_chart(bench.project)
    photos = photo_set(project, usable_cameras(project)[0])

    def tell(done: int, total: int) -> None:
        progress("texture", done, total, "")

    colored = color_texture(
        bench.mesh, photos, bench.renderer, _blending(project.settings.color, "texture"),
        project.settings.unwrap, checker_of(project), tell,
    )  # fmt: skip
    return base_texture(bench.mesh, colored, appearance)


def _check_chart(project: Project) -> None:
    """Raise InputError where [light] names a chart that is not there."""
    gray = project.settings.light.gray
    if gray is not None and not (project.root / gray).is_file():
        path = project.root / gray
        raise InputError(f"no photo of a color chart at {path}; correct `gray` in [light]")


def _with_chart(project: Project) -> Project:
    """The project with the chart of [light] in place of that of [color]."""
    gray, color = project.settings.light.gray, project.settings.color
    if gray is None:
        return project
    changed = replace(color, checker=gray)
    return project.with_settings(project.settings.with_table("color", changed))


def _blending(options: ColorOptions, to: Target) -> ColorOptions:
    """The settings of color for what is wanted here: without highlights, and without rounding
    where the light is weak.
    """
    return replace(options, to=to, bits=16, highlight=max(options.highlight, HIGHLIGHT))


def _wanted(project: Project) -> tuple[ColorOptions, OutputOptions]:
    """The settings of a lit, textured glb."""
    color = replace(project.settings.color, to="texture", bits=8)
    asked = project.settings.output.image
    image = "png" if asked in ("tiff", "exr") else asked
    return color, replace(project.settings.output, models=("glb",), image=image, unlit=False)


def light_facts(appearance: Appearance) -> dict[str, Any]:
    """What light.json holds."""
    light, verdict = appearance.light, appearance.verdict
    sun = None if light is None or light.to_sun is None else light.to_sun.tolist()
    irradiance = None if light is None or light.sun is None else light.sun.tolist()
    return {
        "kind": "natural",
        "accepted": appearance.accepted,
        "reason": appearance.reason,
        "absolute": appearance.absolute,
        "sun": sun,
        "sun_irradiance": irradiance,
        "sky": None if light is None else light.sky.tolist(),
        "verdict": verdict and {**vars(verdict), "gain_db": verdict.gain_db},
    }


def _write(
    folder: Path, source: MeshSource, appearance: Appearance, plan: OutputPlan
) -> tuple[str, ...]:
    """Write the vertices; returns the file names. The ply is the mesh as it was in its file; a
    vertex that the repair dropped has confidence 0 there, and is mid-gray.
    """
    base, known = appearance.base, appearance.confidence
    gray = np.full((1, 3), 0.5, np.float32)
    rows = source.vertex_of_source
    rgb = np.concatenate([base, gray])[rows]
    normals = vertex_normals(source.mesh)
    values = dict(zip(("base_r", "base_g", "base_b"), rgb.T, strict=True)) | {
        "roughness": np.full(len(rows), MATTE, np.float32),
        "metallic": np.zeros(len(rows), np.float32),
        "confidence": np.append(known, np.float32(0))[rows],
    }
    write_ply(
        folder / PLY, source.source_vertices, source.source_faces,
        np.round(srgb_from_linear(rgb) * 255).astype(np.uint8),
        np.concatenate([normals, np.zeros((1, 3))])[rows], plan.provenance.lines, values,
    )  # fmt: skip
    model = ColoredMesh(source.mesh.vertices, source.mesh.faces, base, normals)
    write_colored_glb(folder / GLB, model, False, plan.standing, plan.provenance)
    return PLY, GLB


def _write_texture(
    folder: Path, bench: Workbench, texture: Texture, plan: OutputPlan
) -> tuple[str, ...]:
    """Write the textured model and its pages as images; returns the file names."""
    models = write_texture(folder, bench.mesh, texture, plan)
    images = write_pages(folder / BASE, texture.pages, "png")
    return (*models, *(image.name for image in images))


def appearance_wanted(project: Project) -> bool:
    """Whether the settings ask for it, or it has been made before."""
    return project.settings.light.kind != "none" or project.load_record(STAGE) is not None


def appearance_freshness(project: Project, to: Target | None = None) -> Freshness:
    """Whether the appearance in out/ is what the project's inputs give. to: what is wanted; None =
    what was made the last time.
    """
    record = project.load_record(STAGE)
    reason = changed_inputs(record, _inputs(project, to or _made(record)))
    if record is not None and not reason:
        reason = changed_outputs(project, record)
    return Freshness(STAGE, PLY, not reason, reason)


def _made(record: dict[str, Any] | None) -> Target:
    """What was made the last time."""
    return "texture" if (record or {}).get("to") == "texture" else "vertices"


def _inputs(project: Project, to: Target) -> Inputs:
    seen = seen_inputs(_with_chart(project))
    return {**options_inputs(project, VERSION, *SECTIONS), "to": to, **seen}


def _outcome(project: Project, record: dict[str, Any], kept: bool) -> AppearanceOutcome:
    files, used = tuple(record["outputs"]), tuple(record["used"])
    return AppearanceOutcome(project.out, files, used, record["failed"], record["light"], kept)
