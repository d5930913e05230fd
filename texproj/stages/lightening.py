"""Models of fewer faces than the mesh has, and levels of detail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from texproj.color.result import textured_mesh
from texproj.errors import UsageError
from texproj.mesh import Mesh, TexturedMesh
from texproj.options import ColorOptions, OutputOptions
from texproj.repair import repair
from texproj.simplify import decimated
from texproj.stages.bench import Workbench
from texproj.stages.writing import STEM, OutputPlan, write_model

if TYPE_CHECKING:
    from texproj.color.result import Texture


def check_levels(color: ColorOptions, output: OutputOptions) -> None:
    """Raises UsageError for fewer faces of what has no texture to carry over."""
    if output.faces and color.to == "vertices":
        raise UsageError(
            "faces: a model of fewer faces has a texture; set `to` to texture or patches, or leave"
            " it out"
        )


def levels_of(bench: Workbench, texture: Texture) -> list[TexturedMesh]:
    """A model for each number of faces that the settings ask for; the mesh itself where that has
    no more. Raises TexprojError where the mesh cannot be simplified.
    """
    from texproj.color.baking.bake import baked  # noqa: PLC0415 - slow to load
    from texproj.color.baking.match import Matcher  # noqa: PLC0415

    settings, mesh = bench.project.settings, bench.mesh
    full = Matcher(mesh)
    levels = []
    for count in settings.output.faces:
        if count >= len(mesh.faces):
            levels.append(textured_mesh(mesh, texture, settings.output.normals))
            continue
        light = lighter(mesh, count)
        made = baked(full, texture, light, settings.unwrap)
        model = textured_mesh(light, made.texture, True)
        levels.append(replace(model, normal_map=made.normal_map))
    return levels


def told_of_levels(texture: Texture, levels: Sequence[TexturedMesh], faces: int) -> Texture:
    """The texture with the levels in its numbers, and without notes on a layout that none of them
    has. faces: of the full mesh.
    """
    counts = [len(level.faces) for level in levels]
    notes = texture.notes
    if texture.kept is not None and max(counts) < faces:
        notes = ("the model has fewer faces than the mesh, so its layout is its own",)
    return replace(texture, quality={**texture.quality, "levels": counts}, notes=notes)


def lighter(mesh: Mesh, faces: int) -> Mesh:
    """About so many faces of the same shape. Raises TexprojError."""
    made = decimated(mesh, faces)
    return repair(made.vertices, made.faces).mesh


def write_levels(folder: Path, levels: Sequence[TexturedMesh], plan: OutputPlan) -> tuple[str, ...]:
    """Write the first as the model, the others as its levels of detail; returns the file names."""
    names: tuple[str, ...] = ()
    for number, level in enumerate(levels):
        stem = f"{STEM}_lod{number}" if number else STEM
        names += write_model(folder / stem, level, plan)
    return names
