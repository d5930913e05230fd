"""The light of the photos, of the kind that the settings name, told from the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from texproj.errors import InputError
from texproj.options import ColorOptions, LightOptions
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.checking import checker_of
from texproj.stages.coloring import photo_set, usable_cameras
from texproj.stages.crossing import (
    PhotoPairs,
    by_polarized_flash,
    photo_pairs,
    with_mirrors,
)
from texproj.stages.progress import Progress

if TYPE_CHECKING:
    from texproj.appearance.flash.flash_pages import SurfacePages
    from texproj.appearance.flash.lamp import Lamp
    from texproj.appearance.natural import Chart
    from texproj.appearance.recovered import Appearance
    from texproj.color.result import Texture, VertexColors
    from texproj.color.sampling.photo_set import PhotoSet

HIGHLIGHT = 1.0
"""How strongly highlights are distrusted: they are none of the surface's color."""

PLY = "appearance.ply"
"""The file in out/ that the light is taken out of."""

DAY = len("2026-05-17")
DAY_PHOTOS = 4
"""Fewer tell no light of their own."""

Target = Literal["vertices", "texture"]
LightKind = Literal["natural", "flash", "turntable", "polarized"]


@dataclass(frozen=True, eq=False)
class Pages:
    """A texture of base colors; surface: what else a flash tells on its pages, None where the light
    tells nothing of gloss.
    """

    base: Texture
    surface: SurfacePages | None = None


def kind_of(project: Project, found: Appearance | None = None) -> LightKind:
    """What light is looked for; where the settings do not say it, that which was found."""
    from texproj.appearance.recovered import TurntableLight  # noqa: PLC0415 - slow to load

    said = project.settings.light.kind
    if said != "none":
        return said
    turned = found is not None and isinstance(found.light, TurntableLight)
    return "turntable" if turned else "natural"


def check_light(project: Project) -> None:
    """Raise InputError where [light] names what is not there, or says too little."""
    options = project.settings.light
    if options.gray is not None and not (project.root / options.gray).is_file():
        path = project.root / options.gray
        raise InputError(f"no photo of a color chart at {path}; correct `gray` in [light]")
    told = options.position is not None or options.profile is not None
    if told and options.kind not in ("flash", "polarized"):
        raise InputError(
            f"{project.root / 'project.toml'}: [light] `position` and `profile` are a flash's, and"
            f' `kind` is "{options.kind}"; set it to "flash", or leave them out'
        )
    if options.kind == "flash" or (options.kind == "polarized" and told):
        if options.gray is not None:
            raise InputError(
                f"{project.root / 'project.toml'}: [light] `gray` is for light that stands still,"
                " and this is a flash's: leave it out; `texproj calibrate-flash --reflectance`"
                " makes its colors absolute"
            )
        lamp_of(project)


def lamp_of(project: Project) -> Lamp:
    """The flash that [light] describes."""
    from texproj.appearance.flash.lamp import Lamp  # noqa: PLC0415 - slow to load

    options = project.settings.light
    if options.profile is not None:
        return _calibrated(project, options)
    if options.position is None:
        raise InputError(
            f"{project.root / 'project.toml'}: nothing says where the flash is; give [light]"
            " `position`, its place right of the lens, below and in front of it, in units of the"
            " scan, or `profile`, the file of `texproj calibrate-flash`"
        )
    from texproj.stages.flash_file import FARTHEST  # noqa: PLC0415 - slow to load

    place = np.array(options.position, float)
    if not (np.abs(place) <= FARTHEST).all():
        raise InputError(
            f"{project.root / 'project.toml'}: [light] `position` = {list(options.position)} is no"
            " place; give three numbers in units of the scan"
        )
    return Lamp(place)


def _calibrated(project: Project, options: LightOptions) -> Lamp:
    from texproj.stages.flash_file import read_flash  # noqa: PLC0415 - slow to load

    assert options.profile is not None
    if options.position is not None:
        raise InputError(
            f"{project.root / 'project.toml'}: `position` and `profile` in [light] both say where"
            " the flash is; leave one out"
        )
    path = project.root / options.profile
    if not path.is_file():
        raise InputError(f"no flash calibration at {path}; correct `profile` in [light]")
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
    project = with_chart(bench.project)
    cameras, said = usable_cameras(project)[0], project.settings.light.kind
    pairs = photo_pairs(project, cameras) if said == "polarized" else None
    photos = photo_set(project, cameras) if pairs is None else pairs.crossed

    colors = _blended(bench, photos, progress)
    _require_sight(colors, photos)
    if pairs is not None:
        appearance = _polarized(bench, colors, pairs, progress)
        return replace(colors, failed=colors.failed | pairs.failed), appearance
    if said == "flash":
        return colors, _under_flash(bench, colors, progress)
    return colors, _by_lamps_or_sky(bench, colors, _readable(bench, colors), progress)


def _require_sight(colors: VertexColors, photos: PhotoSet) -> None:
    """Raise InputError where no photo colors any vertex."""
    if (colors.weight > 0).any():
        return
    if set(photos.names) <= set(colors.failed):
        reasons = "; ".join(colors.failed[name] for name in photos.names)
        raise InputError(f"no photo could be read: {reasons}")
    raise InputError(
        "no photo shows any of the mesh: see whether masks/ or work/occluders/ hide all of it, and"
        " whether the cameras look at it"
    )


def _blended(bench: Workbench, photos: PhotoSet, progress: Progress) -> VertexColors:
    """What photos agree on at the vertices."""
    from texproj.color.vertices import color_vertices  # noqa: PLC0415 - slow to load

    project = with_chart(bench.project)

    def tell(done: int, total: int) -> None:
        progress("color", done, total, "")

    options, checker = _blending(project.settings.color, "vertices"), checker_of(project)
    return color_vertices(bench.mesh, photos, bench.renderer, options, checker, tell)


def _by_lamps_or_sky(
    bench: Workbench, colors: VertexColors, photos: PhotoSet, progress: Progress
) -> Appearance:
    """Under light that goes with the camera, or light that stands still."""
    said = bench.project.settings.light.kind
    if said != "natural":
        turned = _on_turntable(bench, colors, photos, progress)
        if said == "turntable" or turned.accepted:
            return turned
    return _in_nature(bench, colors, photos, progress)


def _in_nature(
    bench: Workbench, colors: VertexColors, photos: PhotoSet, progress: Progress
) -> Appearance:
    from texproj.appearance.natural import natural_appearance  # noqa: PLC0415 - slow to load

    def tell(done: int, total: int) -> None:
        progress("appearance", done, total, "")

    gloss = _gloss_of(bench.project)

    def found(shown: VertexColors) -> Appearance:
        seen, chart = shown.weight > 0, _chart_of(shown)
        return natural_appearance(bench.mesh, shown.rgb, seen, chart, tell, gloss)

    days = days_of(bench.project, photos.names)
    if not days:
        return found(colors)
    from texproj.appearance.days import of_several_days  # noqa: PLC0415 - slow to load

    each = {
        day: found(_blended(bench, photos.subset(names), progress)) for day, names in days.items()
    }
    return of_several_days(bench.mesh, each, colors.rgb, colors.weight > 0)


def days_of(project: Project, names: Sequence[str]) -> dict[str, list[str]]:
    """The photos by the day on which EXIF says they were taken; empty where that is one, or where
    some photo does not say it, or a day has too few.
    """
    out: dict[str, list[str]] = {}
    for name in names:
        out.setdefault(project.photo_info(name).taken[:DAY], []).append(name)
    several = len(out) > 1 and "" not in out and min(map(len, out.values())) >= DAY_PHOTOS
    return out if several else {}


def _on_turntable(
    bench: Workbench, colors: VertexColors, photos: PhotoSet, progress: Progress
) -> Appearance:
    from texproj.appearance.turntable.turned import Blended, turntable_appearance  # noqa: PLC0415

    told = colors.quality.get("checker")
    matrix = None if told is None else np.array(told["matrix"])
    seen, gloss = colors.weight > 0, _gloss_of(bench.project)
    blend = Blended(colors.rgb, seen, _chart_of(colors), matrix, gloss)
    unsaid = bench.project.settings.light.kind != "turntable"

    def tell(what: str, done: int, total: int) -> None:
        progress(what, done, total, "")

    return turntable_appearance(bench.mesh, photos, bench.renderer, blend, unsaid, tell)


def _polarized(
    bench: Workbench, colors: VertexColors, pairs: PhotoPairs, progress: Progress
) -> Appearance:
    """Under a flash where [light] says where it is, else under lamps that stand still."""
    pairs = pairs.without(colors.failed)
    options = bench.project.settings.light
    if options.position is not None or options.profile is not None:
        blend = colors.rgb, colors.weight > 0
        return by_polarized_flash(bench, pairs, lamp_of(bench.project), blend, progress)
    found = _by_lamps_or_sky(bench, colors, pairs.crossed, progress)
    return with_mirrors(bench, pairs, found, colors.rgb, progress)


def _gloss_of(project: Project) -> float:
    """Mean reflection in the photos that is none of the paint's."""
    from texproj.appearance.light_fit import GLOSS  # noqa: PLC0415 - slow to load

    return 0.0 if project.settings.light.kind == "polarized" else GLOSS


def _chart_of(colors: VertexColors) -> Chart:
    """What a color chart has made absolute in the colors."""
    told = colors.quality.get("checker")
    return "none" if told is None else "scale" if told["exposure_known"] else "tint"


def _readable(bench: Workbench, colors: VertexColors) -> PhotoSet:
    """The photos but those that could not be read."""
    cameras = usable_cameras(bench.project)[0]
    left = {name: camera for name, camera in cameras.items() if name not in colors.failed}
    return photo_set(bench.project, left)


def _under_flash(bench: Workbench, colors: VertexColors, progress: Progress) -> Appearance:
    from texproj.appearance.flash.recover import Blend, flash_appearance  # noqa: PLC0415

    photos = _readable(bench, colors)
    blend = Blend(colors.rgb, colors.weight > 0)

    def tell(what: str, done: int, total: int) -> None:
        progress(what, done, total, "")

    lamp = lamp_of(bench.project)
    return flash_appearance(bench.mesh, photos, bench.renderer, lamp, blend, tell)


def found_pages(bench: Workbench, appearance: Appearance, progress: Progress) -> Pages:
    """The same for a texture."""
    from texproj.color.texture import color_texture  # noqa: PLC0415 - slow to load

    project = with_chart(bench.project)
    cameras = usable_cameras(project)[0]
    polarized = project.settings.light.kind == "polarized"
    photos = photo_pairs(project, cameras).crossed if polarized else photo_set(project, cameras)

    def tell(done: int, total: int) -> None:
        progress("texture", done, total, "")

    colored = color_texture(
        bench.mesh, photos, bench.renderer, _blending(project.settings.color, "texture"),
        project.settings.unwrap, checker_of(project), tell,
    )  # fmt: skip
    return _pages(bench, appearance, colored, progress)


def _pages(bench: Workbench, appearance: Appearance, colored: Texture, progress: Progress) -> Pages:
    from texproj.appearance.flash.flash_pages import Given, flash_pages  # noqa: PLC0415 - slow to load
    from texproj.appearance.polarized.polarized_pages import polarized_pages  # noqa: PLC0415
    from texproj.appearance.recovered import FlashLight, PolarizedLight  # noqa: PLC0415
    from texproj.appearance.texels import base_texture  # noqa: PLC0415

    light = appearance.light
    if not isinstance(light, FlashLight):
        base = base_texture(bench.mesh, colored, appearance)
        if not isinstance(light, PolarizedLight):
            return Pages(base)
        made = polarized_pages(bench.mesh, base, appearance, light, bench.occlusion)
        return Pages(made.base, made)
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
