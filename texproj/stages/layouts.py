"""What color does with the texture coordinates and textures that the mesh brings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from texproj.errors import InputError, UsageError
from texproj.mesh import Mesh
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.freshness import Inputs, file_inputs

if TYPE_CHECKING:
    from texproj.color.result import Texture

NO_OLD_TEXTURE = (
    'fill = "texture" in [color]: the mesh brings no texture; set it to "around", or give a glb or'
    " obj with its images"
)


def layout_notes(bench: Workbench) -> tuple[str, ...]:
    """What is not done with the mesh's own layout, one sentence each.

    Raises UsageError for settings that contradict each other, InputError for a texture that is
    wanted and not there.
    """
    settings, layout = bench.project.settings, bench.mesh.layout
    to, keep = settings.color.to, settings.unwrap.keep
    if settings.color.fill == "texture":
        if to == "vertices":
            raise UsageError('fill: colors of vertices have no texture to fill; set it to "around"')
        if layout is None or not any(m.image for m in layout.materials):
            raise InputError(NO_OLD_TEXTURE)
    if to == "patches" and keep == "on":
        raise UsageError(
            'keep: patches have a layout of their own; set it to "auto", or to texture'
        )
    if layout is None or to == "texture":
        return ()
    why = "patches have a layout of their own" if to == "patches" else "vertices need none"
    return (f"the mesh's own texture coordinates are not used: {why}",)


def layout_inputs(project: Project) -> Inputs:
    """The files of the mesh's own textures, where they are used: to fill, or as maps beside the
    colors, which only a gltf names.
    """
    settings = project.settings
    maps = settings.color.to == "texture" and settings.unwrap.keep != "off"
    maps = maps and project.mesh_path.suffix.lower() == ".gltf"
    if not maps and settings.color.fill != "texture":
        return {}
    from texproj.formats.meshes.companions import companions  # noqa: PLC0415 - slow to load

    return file_inputs(project, **companions(project.mesh_path))


def mesh_to_fill(bench: Workbench) -> Mesh:
    """The mesh, with pages at least as large as its own textures where these will fill them."""
    mesh = bench.mesh
    if bench.project.settings.color.fill != "texture" or mesh.layout is None:
        return mesh
    from texproj.formats.meshes import picture_side  # noqa: PLC0415 - slow to load

    sized = tuple(replace(m, least_px=picture_side(m)) for m in mesh.layout.materials)
    return replace(mesh, layout=replace(mesh.layout, materials=sized))


def filled_from_mesh(bench: Workbench, texture: Texture) -> Texture:
    """The texture with the mesh's own one where no photo sees, if the settings ask for that.

    Raises InputError for an image that cannot be read.
    """
    mesh, layout = bench.mesh, bench.mesh.layout
    if bench.project.settings.color.fill != "texture" or layout is None:
        return texture
    from texproj.color.filling.old_texture import with_old_texture  # noqa: PLC0415 - slow to load
    from texproj.formats.meshes import read_picture  # noqa: PLC0415

    def picture(material: int, tile: int) -> NDArray[Any] | None:
        try:
            return read_picture(layout.materials[material], tile)
        except InputError as error:
            raise InputError(
                f"{bench.project.mesh_path}: {error}; copy the image again, or set fill ="
                ' "around" in [color]'
            ) from None

    return with_old_texture(mesh, texture, layout, picture)
