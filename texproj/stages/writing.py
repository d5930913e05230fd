"""The files of a colored model."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.color.result import Texture, VertexColors, textured_mesh
from texproj.errors import UsageError
from texproj.formats.models import (
    GlbImage,
    ImageFormat,
    file_endings,
    numbered,
    page_files,
    require_basisu,
    to_8_bit,
    write_colored_glb,
    write_glb,
    write_ktx2,
    write_obj,
    write_pages,
    write_ply,
    write_usdz,
)
from texproj.formats.models.images import IMAGE_SUFFIXES
from texproj.mesh import ColoredMesh, Mesh, MeshSource, TexturedMesh, vertex_normals
from texproj.options import ColorOptions, OutputOptions
from texproj.photo import srgb_from_linear
from texproj.provenance import NOTHING, Provenance
from texproj.standing import Measured, Standing, standing

STEM = "model"
PLY, GLB, OBJ = "model.ply", "model.glb", "model.obj"
KTX2_SIZE = 4
"""Width and height of a page in KTX 2 are multiples of it (KHR_texture_basisu)."""

Kind = Literal["ply", "glb", "obj", "usdz"]
ON_REQUEST: frozenset[Kind] = frozenset({"usdz"})
"""Kinds that models = ["auto"] leaves out."""


@dataclass(frozen=True)
class OutputPlan:
    """Which files are written, and how. obj_image, glb_image: formats of their pages; bits: per
    channel, where a file can hold them; standing: how the scan stands; provenance: what the files
    say of what made them.
    """

    models: tuple[Kind, ...]
    obj_image: ImageFormat
    glb_image: GlbImage
    bits: int
    options: OutputOptions
    standing: Standing
    provenance: Provenance = NOTHING


def output_plan(
    color: ColorOptions,
    output: OutputOptions,
    cameras: Sequence[Camera] = (),
    measured: Sequence[Measured] = (),
) -> OutputPlan:
    """What the settings ask for; the cameras and what these have `measured` (as `upward` takes it)
    tell how the scan stands. Raises UsageError for what cannot be written.
    """
    textured = color.to != "vertices"
    possible: tuple[Kind, ...] = ("glb", "obj", "usdz") if textured else ("ply", "glb")
    asked: set[Kind] = {model for model in output.models if model != "auto"}
    if not output.models:
        raise UsageError(f"models: none is named; choose from {', '.join(possible)}, or auto")
    if "auto" in output.models:
        asked |= set(possible) - ON_REQUEST if textured else {"ply"}
        asked |= {"glb"} if color.bits == 16 else set()
    for model in sorted(asked - set(possible)):
        raise UsageError(
            f"models: {model} cannot hold what `to = {color.to!r}` makes; choose from"
            f" {', '.join(possible)}"
        )
    image = output.image
    plan = OutputPlan(
        tuple(kind for kind in possible if kind in asked),
        "png" if image == "ktx2" else image,
        "png" if image == "tiff" or image == "exr" else image,  # noqa: PLR1714 - mypy narrows
        color.bits,
        output,
        standing(output.up, output.unit, cameras, measured),
    )
    _check_bits(plan, textured)
    if output.compression != "none" and not (textured and "glb" in asked):
        raise UsageError(
            'compression: only a glb with a texture is compressed; set it to "none", or `to` to'
            " texture and add glb to models"
        )
    if textured and image == "ktx2":
        if "glb" not in asked:
            raise UsageError("image: ktx2 is for glb alone; add it to models, or choose another")
        require_basisu()
    return plan


def _check_bits(plan: OutputPlan, textured: bool) -> None:
    if plan.bits == 8:
        return
    deep = (
        "obj" in plan.models and plan.obj_image in ("png", "tiff", "exr")
        if textured
        else "glb" in plan.models
    )
    if not deep:
        where = "an obj with png, tiff or exr images" if textured else "a glb"
        raise UsageError(f"bits: 16 bits are only held by {where}; add that, or set bits to 8")


def write_vertices(
    folder: Path, source: MeshSource, colors: VertexColors, plan: OutputPlan
) -> tuple[str, ...]:
    """Write each vertex with its color; returns the file names.

    The ply is the mesh as it was in its file; a vertex that the repair dropped has no color there:
    it is mid-gray. The glb is the repaired mesh with linear colors, not rounded.
    """
    said = plan.provenance.lines
    normals = vertex_normals(source.mesh) if plan.options.normals else None
    if "ply" in plan.models:
        encoded = np.round(srgb_from_linear(colors.rgb) * 255).astype(np.uint8)
        rgb = _with_one_more(encoded, 128)[source.vertex_of_source]
        units = None if normals is None else _with_one_more(normals, 0)[source.vertex_of_source]
        write_ply(folder / PLY, source.source_vertices, source.source_faces, rgb, units, said)
    if "glb" in plan.models:
        model = ColoredMesh(source.mesh.vertices, source.mesh.faces, colors.rgb, normals)
        shown = plan.options.unlit, plan.standing
        write_colored_glb(folder / GLB, model, *shown, plan.provenance)
    return tuple(f"{STEM}.{kind}" for kind in plan.models)


def _with_one_more(rows: NDArray[Any], value: int) -> NDArray[Any]:
    """The rows and one of `value`: that of number -1."""
    return np.concatenate([rows, np.full((1, rows.shape[1]), value, rows.dtype)])


def write_texture(folder: Path, mesh: Mesh, texture: Texture, plan: OutputPlan) -> tuple[str, ...]:
    """Write the textured mesh and its images; returns the file names."""
    return write_model(folder / STEM, textured_mesh(mesh, texture, plan.options.normals), plan)


def write_model(stem: Path, model: TexturedMesh, plan: OutputPlan) -> tuple[str, ...]:
    """Write the files of a model, whose names begin with `stem`; returns their names.

    The text of the obj is written while the images are encoded. A normal map is written beside the
    obj, and into a glb that is lit and holds no ktx2.
    """
    endings = file_endings(model)
    images = page_files(stem, endings, IMAGE_SUFFIXES[plan.obj_image])
    bumps = page_files(stem.with_name(f"{stem.name}_normals"), endings, IMAGE_SUFFIXES["png"])
    bumps = bumps if model.normal_map is not None else []
    written: list[Path] = []
    with ThreadPoolExecutor(1) as beside:
        if "obj" in plan.models:
            files, said = [*images, *bumps], plan.provenance.lines
            text = beside.submit(write_obj, stem.with_suffix(".obj"), model, files, said)
            write_pages(stem, model.pages, plan.obj_image, plan.options.quality, endings)
            _write_bumps(stem, model, endings)
        if "glb" in plan.models:
            written.append(_write_glb(stem, model, images, plan))
        if "usdz" in plan.models:
            written.append(_write_usdz(stem, model, images, plan))
        if "obj" in plan.models:
            written += [*text.result(), *images, *bumps]
    return tuple(path.name for path in written)


def _write_bumps(stem: Path, model: TexturedMesh, endings: Sequence[str]) -> list[Path]:
    if model.normal_map is None:
        return []
    return write_pages(
        stem.with_name(f"{stem.name}_normals"), model.normal_map.pages, "png", endings=endings
    )


def _write_glb(
    stem: Path, model: TexturedMesh, obj_images: Sequence[Path], plan: OutputPlan
) -> Path:
    """Write the glb, with the images of the obj if they are what it wants; returns its file."""
    shared = "obj" in plan.models and plan.obj_image == plan.glb_image and plan.bits == 8
    if plan.glb_image == "ktx2":
        model = padded(model, KTX2_SIZE)
    inside = stem.with_name(f"inside_{stem.name}")
    images = list(obj_images) if shared else _glb_images(inside, model, plan)
    bumps: list[Path] = []
    if model.normal_map is not None and not plan.options.unlit and plan.glb_image != "ktx2":
        bumped = inside.with_name(f"{inside.name}_normals")
        bumps = write_pages(bumped, model.normal_map.pages, plan.glb_image, plan.options.quality)
    shown = plan.options.unlit, plan.options.compression == "draco", plan.standing
    path = stem.with_suffix(".glb")
    write_glb(path, model, [*images, *bumps], *shown, plan.provenance)
    for image in [*bumps, *(() if shared else images)]:
        image.unlink()
    return path


def _write_usdz(
    stem: Path, model: TexturedMesh, obj_images: Sequence[Path], plan: OutputPlan
) -> Path:
    """Write the usdz, which holds png and jpeg alone, with the images of the obj if they fit;
    returns its file.
    """
    kind: ImageFormat = "jpeg" if plan.obj_image == "jpeg" else "png"
    shared = "obj" in plan.models and plan.obj_image == kind and plan.bits == 8
    images = obj_images
    if not shared:
        pages = tuple(to_8_bit(page) for page in model.pages)
        inside = stem.with_name(f"inside_{stem.name}")
        images = write_pages(inside, pages, kind, plan.options.quality)
    shown = plan.options.unlit, plan.standing
    path = stem.with_suffix(".usdz")
    write_usdz(path, model, images, *shown, plan.provenance)
    for image in () if shared else images:
        image.unlink()
    return path


def _glb_images(stem: Path, model: TexturedMesh, plan: OutputPlan) -> list[Path]:
    """The pages in 8 bits, as files that go once they are inside the glb."""
    pages = tuple(to_8_bit(page) for page in model.pages)
    if plan.glb_image != "ktx2":
        return write_pages(stem, pages, plan.glb_image, plan.options.quality)
    sources = write_pages(stem, pages, "png")
    images = page_files(stem, numbered(len(pages)), ".ktx2")
    for source, image in zip(sources, images, strict=True):
        write_ktx2(source, image)
        source.unlink()
    return images


def padded(model: TexturedMesh, multiple: int) -> TexturedMesh:
    """The same model on pages whose sides are multiples: the last row and column are repeated."""
    pages: list[NDArray[Any]] = []
    shrink = np.ones((len(model.uv), 2))
    for number, page in enumerate(model.pages):
        height, width = page.shape[:2]
        below, right = -height % multiple, -width % multiple
        pages.append(np.pad(page, ((0, below), (0, right), (0, 0)), "edge"))
        on_page = np.unique(model.uv_faces[model.page_of_face == number])
        shrink[on_page] = width / (width + right), height / (height + below)
    uv_down = (model.uv * (1, -1) + (0, 1)) * shrink
    return replace(model, uv=uv_down * (1, -1) + (0, 1), pages=tuple(pages))
