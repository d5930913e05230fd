"""The files of an appearance: models, images, and what was found of light and materials."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.color.result import textured_mesh
from texproj.errors import OutputError
from texproj.formats.models import (
    Gloss,
    Images,
    Parts,
    numbered,
    page_files,
    write_colored_glb,
    write_glossy_glb,
    write_lit_glb,
    write_obj,
    write_pages,
    write_ply,
)
from texproj.mesh import ColoredMesh, Mesh, MeshSource, vertex_normals
from texproj.photo import LUMINANCE, srgb_from_linear
from texproj.stages.lighting import PLY, LightKind, Pages
from texproj.stages.writing import OutputPlan, write_texture

if TYPE_CHECKING:
    from texproj.appearance.flash.pooled import Pooled
    from texproj.appearance.recovered import (
        Appearance,
        FlashLight,
        NaturalLight,
        PolarizedLight,
    )

GLB, LIGHT, MATERIALS = "appearance.glb", "light.json", "materials.json"
BASE, ROUGHNESS, METALLIC, CONFIDENCE = "base_color", "roughness", "metallic", "confidence"
NORMAL = "normal"
MODEL_GLB, MODEL_OBJ = "model.glb", "model.obj"


def write_appearance(
    folder: Path, source: MeshSource, appearance: Appearance, plan: OutputPlan,
    light: dict[str, Any],
) -> tuple[str, ...]:  # fmt: skip
    """Write the vertices, the light (`light_facts`) and the materials; returns the file names."""
    files = _write_vertices(folder, source, appearance, plan)
    _write_json(folder / LIGHT, light)
    materials = material_facts(source.mesh, appearance)
    if materials is None:
        return (*files, LIGHT)
    _write_json(folder / MATERIALS, materials)
    return (*files, LIGHT, MATERIALS)


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, indent=1), encoding="utf-8")


def _write_vertices(
    folder: Path, source: MeshSource, appearance: Appearance, plan: OutputPlan
) -> tuple[str, ...]:
    """The ply is the mesh as it was in its file; a vertex that the repair dropped has confidence 0
    there, and is mid-gray.
    """
    rows = source.vertex_of_source
    rgb = np.concatenate([appearance.base, np.full((1, 3), 0.5, np.float32)])[rows]
    normals = vertex_normals(source.mesh)

    def with_one_more(values: NDArray[np.float32], value: float) -> NDArray[np.float32]:
        return np.append(values, np.float32(value))[rows]

    values = dict(zip(("base_r", "base_g", "base_b"), rgb.T, strict=True)) | {
        "roughness": with_one_more(appearance.roughness, 1),
        "metallic": with_one_more(appearance.metallic, 0),
        "confidence": with_one_more(appearance.confidence, 0),
    }
    if appearance.mirrored is not None:
        values["mirrored"] = with_one_more(appearance.mirrored, 0)
    write_ply(
        folder / PLY, source.source_vertices, source.source_faces,
        np.round(srgb_from_linear(rgb) * 255).astype(np.uint8),
        np.concatenate([normals, np.zeros((1, 3))])[rows], plan.provenance.lines, values,
    )  # fmt: skip
    model = ColoredMesh(source.mesh.vertices, source.mesh.faces, appearance.base, normals)
    light = _labelled(appearance)
    if light is None:
        write_colored_glb(folder / GLB, model, False, plan.standing, plan.provenance)
    else:
        parts = Parts(_gloss(_kinds(light)), _most(light.label[source.mesh.faces]))
        write_glossy_glb(folder / GLB, model, parts, plan.standing, plan.provenance)
    return PLY, GLB


def flash_of(appearance: Appearance) -> FlashLight | None:
    """The flash, where it was one and is believed."""
    from texproj.appearance.recovered import FlashLight  # noqa: PLC0415 - slow to load

    return appearance.light if isinstance(appearance.light, FlashLight) else None


def _labelled(appearance: Appearance) -> FlashLight | PolarizedLight | None:
    """Light that tells what each vertex is made of, where it is believed."""
    from texproj.appearance.recovered import FlashLight, PolarizedLight  # noqa: PLC0415

    light = appearance.light
    return light if isinstance(light, FlashLight | PolarizedLight) else None


def _kinds(light: FlashLight | PolarizedLight) -> Sequence[Pooled]:
    """The materials that it tells of."""
    from texproj.appearance.recovered import FlashLight  # noqa: PLC0415 - slow to load

    return light.found.materials if isinstance(light, FlashLight) else light.kinds


def _gloss(kinds: Sequence[Pooled]) -> list[Gloss]:
    return [
        Gloss(
            f"material_{number}", one.roughness, float(one.material.metal),
            one.material.f0 if one.f0_known and not one.material.metal else None,
        )
        for number, one in enumerate(kinds)
    ]  # fmt: skip


def _most(label: NDArray[np.intp]) -> NDArray[np.intp]:
    """(F,) the label of most corners of (F, 3), of the first where all differ."""
    return np.where(label[:, 1] == label[:, 2], label[:, 1], label[:, 0])


def write_textured(folder: Path, mesh: Mesh, pages: Pages, plan: OutputPlan) -> tuple[str, ...]:
    """Write the textured model and its pages as images; returns the file names."""
    base = write_pages(folder / BASE, pages.base.pages, "png")
    surface = pages.surface
    if surface is None:
        models = write_texture(folder, mesh, pages.base, plan)
        return (*models, *(image.name for image in base))
    flat = replace(pages.base, kept=None)  # uv on each page in 0..1
    model = replace(textured_mesh(mesh, flat), normal_map=surface.normal_map)
    rough = _write_gray(folder / ROUGHNESS, [page[..., 1] for page in surface.orm])
    metal = _write_gray(folder / METALLIC, [page[..., 2] for page in surface.orm])
    sure = _write_gray(folder / CONFIDENCE, surface.confidence)
    bumps = surface.normal_map.pages if surface.normal_map else ()
    normal = write_pages(folder / NORMAL, bumps, "png")
    mirrors, factor = (
        (surface.specular.pages, surface.specular.factor) if surface.specular else ((), 1.0)
    )
    orm = write_pages(folder / "inside_orm", surface.orm, "png")
    specular = write_pages(folder / "inside_specular", mirrors, "png")
    images = Images(base, orm, normal, specular, factor)
    write_lit_glb(folder / MODEL_GLB, model, images, plan.standing, plan.provenance)
    for image in (*orm, *specular):
        image.unlink()
    maps = list(zip(rough, metal, strict=True))
    written = write_obj(folder / MODEL_OBJ, model, [*base, *normal], plan.provenance.lines, maps)
    files = [folder / MODEL_GLB, *written, *base, *rough, *metal, *sure, *normal]
    return tuple(file.name for file in files)


def _write_gray(stem: Path, pages: Sequence[NDArray[np.uint8]]) -> list[Path]:
    """Pages of numbers, not of colors: png without a color space."""
    files = page_files(stem, numbered(len(pages)), ".png")
    for file, page in zip(files, pages, strict=True):
        if not cv2.imwrite(str(file), page):
            raise OutputError(f"{file} cannot be written")
    return files


def light_facts(
    appearance: Appearance, kind: LightKind, pages: Pages | None = None
) -> dict[str, Any]:
    """What light.json holds. kind: of light that was looked for; pages: if there are any."""
    verdict = appearance.verdict
    told = {
        "kind": kind,
        "sun": None,
        "accepted": appearance.accepted,
        "reason": appearance.reason,
        "absolute": appearance.absolute,
        "verdict": verdict and {**vars(verdict), "gain_db": verdict.gain_db},
    }
    light = flash_of(appearance)
    if kind == "flash":
        return told | ({} if light is None else _flash_facts(light)) | _normal_facts(pages)
    if kind == "turntable":
        return told | _room_facts(appearance)
    if kind == "polarized":
        return told | _room_facts(appearance) | _sky_facts(appearance) | _output(appearance)
    return told | _sky_facts(appearance)


def _output(appearance: Appearance) -> dict[str, Any]:
    from texproj.appearance.recovered import PolarizedLight  # noqa: PLC0415 - slow to load

    light = appearance.light
    return {"output": light.output if isinstance(light, PolarizedLight) else None}


def _room_facts(appearance: Appearance) -> dict[str, Any]:
    from texproj.appearance.recovered import TurntableLight  # noqa: PLC0415 - slow to load

    light = appearance.light
    if not isinstance(light, TurntableLight):
        return {"sun": None, "sky": None, "room": None}
    lamps = [
        {
            "direction": lamp.direction.tolist(),
            "distance": lamp.distance if np.isfinite(lamp.distance) else None,
            "radius_deg": lamp.radius_deg,
            "irradiance": strength.tolist(),
        }
        for lamp, strength in zip(light.lamps, light.strength, strict=True)
    ]
    room = {"sky": light.sky.tolist(), "lamps": lamps, "exposure": light.exposure}
    return {"sun": None, "sky": None, "room": room}


def _sky_facts(appearance: Appearance) -> dict[str, Any]:
    from texproj.appearance.recovered import DaysLight, NaturalLight  # noqa: PLC0415

    light = appearance.light
    if isinstance(light, DaysLight):
        days = {name: _sky(day) for name, day in light.days.items()}
        return {"sun": None, "sun_irradiance": None, "sky": None, "days": days}
    if not isinstance(light, NaturalLight):
        return {"sun": None, "sun_irradiance": None, "sky": None}
    return _sky(light)


def _sky(light: NaturalLight) -> dict[str, Any]:
    return {
        "sun": None if light.to_sun is None else light.to_sun.tolist(),
        "sun_irradiance": None if light.sun is None else light.sun.tolist(),
        "sky": light.sky.tolist(),
    }


def _normal_facts(pages: Pages | None) -> dict[str, Any]:
    """Whether pages have normals of their own, and by what that was judged."""
    if pages is None or pages.surface is None or pages.surface.normals is None:
        return {}
    verdict = pages.surface.normals
    return {"normals": {**vars(verdict), "reason": verdict.reason}}


def _flash_facts(light: FlashLight) -> dict[str, Any]:
    lamp = light.found.lamp
    return {
        "lamp": lamp.place.tolist(),
        "intensity": lamp.intensity,
        "intensity_known": not light.found.assumed,
        "output": light.output,
    }


def material_facts(mesh: Mesh, appearance: Appearance) -> list[dict[str, Any]] | None:
    """What materials.json holds: one entry a material; None where the light tells of none."""
    light = _labelled(appearance)
    if light is None:
        return None
    seen = appearance.confidence > 0
    out = []
    for number, one in enumerate(_kinds(light)):
        rows = (light.label == number) & seen
        base = appearance.base[rows]
        out.append({
            "name": f"material_{number}",
            "metallic": one.material.metal,
            "roughness": one.roughness,
            "f0": one.material.f0 if one.f0_known else None,
            "share": float(rows.sum() / max(seen.sum(), 1)),
            "base_color": np.median(base, axis=0).tolist() if len(base) else None,
            "luminance": float(np.median(base @ LUMINANCE)) if len(base) else None,
        })  # fmt: skip
    return out
