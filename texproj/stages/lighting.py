"""The light of the photos, of the kind that the settings name, told from the surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from texproj.errors import InputError
from texproj.options import ColorOptions, LightOptions
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.checking import checker_of
from texproj.stages.coloring import photo_set, usable_cameras
from texproj.stages.progress import Progress

if TYPE_CHECKING:
    from texproj.appearance.flash.flash_pages import SurfacePages
    from texproj.appearance.flash.lamp import Lamp
    from texproj.appearance.natural import Chart
    from texproj.appearance.recovered import Appearance
    from texproj.color.result import Texture, VertexColors

HIGHLIGHT = 1.0
"""How strongly highlights are distrusted: they are none of the surface's color."""

Target = Literal["vertices", "texture"]
LightKind = Literal["natural", "flash"]


@dataclass(frozen=True, eq=False)
class Pages:
    """A texture of base colors; surface: what else a flash tells on its pages, None where the light
    tells nothing of gloss.
    """

    base: Texture
    surface: SurfacePages | None = None


def kind_of(project: Project) -> LightKind:
    """What light is looked for."""
    return "flash" if project.settings.light.kind == "flash" else "natural"


def check_light(project: Project) -> None:
    """Raise InputError where [light] names what is not there, or says too little."""
    options = project.settings.light
    if options.gray is not None and not (project.root / options.gray).is_file():
        path = project.root / options.gray
        raise InputError(f"no photo of a color chart at {path}; correct `gray` in [light]")
    if kind_of(project) == "flash":
        lamp_of(project)


def lamp_of(project: Project) -> Lamp:
    """The flash that [light] describes."""
    from texproj.appearance.flash.lamp import Lamp  # noqa: PLC0415 - slow to load

    options = project.settings.light
    if options.flash is not None:
        return _calibrated(project, options)
    if options.lamp is None:
        raise InputError(
            f"{project.root / 'project.toml'}: nothing says where the flash is; give [light]"
            " `lamp`, its place right of the lens, below and in front of it, in units of the scan,"
            " or `flash`, the file of `texproj calibrate-flash`"
        )
    from texproj.stages.flash_file import FARTHEST  # noqa: PLC0415 - slow to load

    place = np.array(options.lamp, float)
    if not (np.abs(place) <= FARTHEST).all():
        raise InputError(
            f"{project.root / 'project.toml'}: [light] `lamp` = {list(options.lamp)} is no place;"
            " give three numbers in units of the scan"
        )
    return Lamp(place)


def _calibrated(project: Project, options: LightOptions) -> Lamp:
    from texproj.stages.flash_file import read_flash  # noqa: PLC0415 - slow to load

    assert options.flash is not None
    if options.lamp is not None:
        raise InputError(
            f"{project.root / 'project.toml'}: `lamp` and `flash` in [light] both say where the"
            " flash is; leave one out"
        )
    path = project.root / options.flash
    if not path.is_file():
        raise InputError(f"no flash calibration at {path}; correct `flash` in [light]")
    return read_flash(path)


def with_chart(project: Project) -> Project:
    """The project with the chart of [light] in place of that of [color]."""
    gray, color = project.settings.light.gray, project.settings.color
    if gray is None:
        return project
    changed = replace(color, checker=gray)
    return project.with_settings(project.settings.with_table("color", changed))


def found_appearance(bench: Workbench, progress: Progress) -> tuple[VertexColors, Appearance]:
    """What the photos show at the vertices, and what of that is the surface's own."""
    from texproj.color.vertices import color_vertices  # noqa: PLC0415 - slow to load

    project = with_chart(bench.project)
    photos = photo_set(project, usable_cameras(project)[0])

    def tell(done: int, total: int) -> None:
        progress("color", done, total, "")

    options, checker = _blending(project.settings.color, "vertices"), checker_of(project)
    colors = color_vertices(bench.mesh, photos, bench.renderer, options, checker, tell)
    if kind_of(project) == "flash":
        return colors, _under_flash(bench, colors, progress)
    return colors, _in_nature(bench, colors, progress)


def _in_nature(bench: Workbench, colors: VertexColors, progress: Progress) -> Appearance:
    from texproj.appearance.natural import natural_appearance  # noqa: PLC0415 - slow to load

    told = colors.quality.get("checker")
    chart: Chart = "none" if told is None else "scale" if told["exposure_known"] else "tint"

    def tell(done: int, total: int) -> None:
        progress("appearance", done, total, "")

    return natural_appearance(bench.mesh, colors.rgb, colors.weight > 0, chart, tell)


def _under_flash(bench: Workbench, colors: VertexColors, progress: Progress) -> Appearance:
    from texproj.appearance.flash.recover import Blend, flash_appearance  # noqa: PLC0415

    cameras = usable_cameras(bench.project)[0]
    cameras = {name: camera for name, camera in cameras.items() if name not in colors.failed}
    photos = photo_set(bench.project, cameras)
    blend = Blend(colors.rgb, colors.weight > 0)

    def tell(what: str, done: int, total: int) -> None:
        progress(what, done, total, "")

    lamp = lamp_of(bench.project)
    return flash_appearance(bench.mesh, photos, bench.renderer, lamp, blend, tell)


def found_pages(bench: Workbench, appearance: Appearance, progress: Progress) -> Pages:
    """The same for a texture."""
    from texproj.color.texture import color_texture  # noqa: PLC0415 - slow to load

    project = with_chart(bench.project)
    photos = photo_set(project, usable_cameras(project)[0])

    def tell(done: int, total: int) -> None:
        progress("texture", done, total, "")

    colored = color_texture(
        bench.mesh, photos, bench.renderer, _blending(project.settings.color, "texture"),
        project.settings.unwrap, checker_of(project), tell,
    )  # fmt: skip
    return _pages(bench, appearance, colored, progress)


def _pages(bench: Workbench, appearance: Appearance, colored: Texture, progress: Progress) -> Pages:
    from texproj.appearance.flash.flash_pages import Given, flash_pages  # noqa: PLC0415 - slow to load
    from texproj.appearance.recovered import FlashLight  # noqa: PLC0415
    from texproj.appearance.texels import base_texture  # noqa: PLC0415

    light = appearance.light
    if kind_of(bench.project) == "natural" or not isinstance(light, FlashLight):
        return Pages(base_texture(bench.mesh, colored, appearance))
    cameras = usable_cameras(bench.project)[0]
    photos = photo_set(bench.project, {name: cameras[name] for name in light.names})
    given = Given(bench.mesh, colored, bench.occlusion)

    def tell(done: int) -> None:
        progress("flash", done, len(photos), "")

    made = flash_pages(given, photos, bench.renderer, appearance, tell)
    return Pages(made.base, made)


def _blending(options: ColorOptions, to: Target) -> ColorOptions:
    """The settings of color for what is wanted here: without highlights, and without rounding
    where the light is weak.
    """
    return replace(options, to=to, bits=16, highlight=max(options.highlight, HIGHLIGHT))
