"""Stage `appearance`: the light of the photos found and taken out of the colors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from texproj.errors import InputError
from texproj.files import staging
from texproj.options import ColorOptions, OutputOptions
from texproj.project import Project
from texproj.resources.scratch import Scratch
from texproj.stages.bench import Workbench
from texproj.stages.coloring import (
    changed_outputs,
    remove_leftovers,
    seen_inputs,
    usable_cameras,
)
from texproj.stages.crossing import crossed_inputs
from texproj.stages.freshness import Freshness, Inputs, changed_inputs, options_inputs
from texproj.stages.lighting import (
    PLY,
    Target,
    check_light,
    found_appearance,
    found_pages,
    kind_of,
    with_chart,
)
from texproj.stages.occluding import keep_occluders
from texproj.stages.outcomes import Tally
from texproj.stages.progress import Progress, silent
from texproj.stages.provenance import provenance_of

STAGE = "appearance"
VERSION = 4
SECTIONS = ("color", "unwrap", "light", "output", "render")


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
    told = light["verdict"]
    if light["kind"] == "flash":
        yield (
            f"flash: {told['photos']} photos left out of the fit are predicted by"
            f" {told['lit_db']:.1f} dB, by matte colors {told['matte_db']:.1f}, by plain ones"
            f" {told['plain_db']:.1f}; {100 * told['highlights']:.0f} % of the surface saw its"
            " highlight"
        )
        yield f"base color: {'reflectance' if light['absolute'] else 'known up to a factor'}"
        yield from _normals_line(light.get("normals"))
        return
    if light["kind"] == "polarized":
        yield "polarized: paint from photos-crossed/, mirrors from what photos/ show beyond it"
        yield (
            f"held out: {told['lit_db']:.1f} dB with the light, {told['plain_db']:.1f} dB without"
        )
        yield f"base color: {known_as(light)}"
        return
    if light["kind"] == "turntable":
        lamps = len(light["room"]["lamps"])
        yield (
            f"turntable: a soft light and {lamps} lamp{'' if lamps == 1 else 's'} that stood still;"
            f" {told['photos']} photos left out of the fit are predicted by {told['lit_db']:.1f}"
            f" dB, by plain colors {told['plain_db']:.1f}"
        )
        yield f"base color: {known_as(light)}"
        return
    sun, days = light["sun"], light.get("days", {})
    if days:
        yield f"light: that of {len(days)} days, {', '.join(days)}, each of its own"
    elif sun is None:
        yield "light: a sky, no sun"
    else:
        x, y, z = sun
        yield f"light: a sky and a sun towards ({x:.2f}, {y:.2f}, {z:.2f})"
    yield (
        f"parts of the surface left out of the fit: {told['lit_db']:.1f} dB with the light,"
        f" {told['plain_db']:.1f} dB without"
    )
    yield f"base color: {known_as(light)}"


def known_as(light: dict[str, Any]) -> str:
    """What the base color is."""
    if light["absolute"]:
        return "reflectance"
    if any(lamp["distance"] is not None for lamp in (light.get("room") or {}).get("lamps", ())):
        return "known up to a factor: a lamp is so near that a color chart fixes the tint alone"
    return "known up to a factor; a color chart fixes it"


def _normals_line(told: dict[str, Any] | None) -> Iterator[str]:
    """What was found of normals finer than the mesh's, for people."""
    if told is None:
        return
    if not told["accepted"]:
        yield f"normals: those of the mesh; {told['reason']}"
        return
    yield (
        f"normals: {100 * told['share']:.0f} % of the surface has its own; with them photos left"
        f" out are predicted by {told['own_db']:.1f} dB, with the mesh's by {told['mesh_db']:.1f}"
    )


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
    from texproj.stages.appearance_files import (  # noqa: PLC0415 - slow to load
        light_facts,
        write_appearance,
        write_textured,
    )
    from texproj.stages.writing import output_plan  # noqa: PLC0415

    check_light(project)
    cameras, failed = usable_cameras(project)
    with closing(Scratch()) as scratch:
        keep_occluders(bench, cameras, progress, scratch)
    inputs = _inputs(project, to)
    measured = [project.photo_info(name).up_in_cam for name in cameras]
    plan = output_plan(*_wanted(project), tuple(cameras.values()), measured)
    colors, appearance = found_appearance(bench, progress)
    failed |= colors.failed
    if not set(cameras) - set(failed):
        raise InputError(f"no photo could be read: {'; '.join(failed.values())}")
    pages = found_pages(bench, appearance, progress) if to == "texture" else None
    light = light_facts(appearance, kind_of(project, appearance), pages)
    used = [name for name in cameras if name not in failed]
    plan = replace(plan, provenance=provenance_of(project, used))
    with staging(project.out) as folder:
        files = write_appearance(folder, bench.source, appearance, plan, light)
        if pages is not None:
            files += write_textured(folder, bench.mesh, pages, plan)
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


def _wanted(project: Project) -> tuple[ColorOptions, OutputOptions]:
    """The settings of a lit, textured glb."""
    color = replace(project.settings.color, to="texture", bits=8)
    asked = project.settings.output.image
    image = "png" if asked in ("tiff", "exr") else asked
    return color, replace(project.settings.output, models=("glb",), image=image, unlit=False)


def appearance_wanted(project: Project) -> bool:
    """Whether the settings ask for it, or it has been made before."""
    return project.settings.light.kind != "none" or project.load_record(STAGE) is not None


def appearance_freshness(project: Project, to: Target | None = None) -> Freshness:
    """Whether the appearance in out/ is what the project's inputs give. to: what is wanted; None =
    what was made the last time.
    """
    record = project.load_record(STAGE)
    reason = changed_inputs(record, _inputs(project, to or _made(record)), project.settings.exclude)
    if record is not None and not reason:
        reason = changed_outputs(project, record)
    return Freshness(STAGE, PLY, not reason, reason)


def _made(record: dict[str, Any] | None) -> Target:
    """What was made the last time."""
    return "texture" if (record or {}).get("to") == "texture" else "vertices"


def _inputs(project: Project, to: Target) -> Inputs:
    seen = seen_inputs(with_chart(project))
    crossed = crossed_inputs(project)
    return {**options_inputs(project, VERSION, *SECTIONS), "to": to, **seen, **crossed}


def _outcome(project: Project, record: dict[str, Any], kept: bool) -> AppearanceOutcome:
    files, used = tuple(record["outputs"]), tuple(record["used"])
    return AppearanceOutcome(project.out, files, used, record["failed"], record["light"], kept)
