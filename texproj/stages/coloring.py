"""Stage `color`: the registered photos on the surface, written as a model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from texproj.camera import Camera
from texproj.errors import InputError, OutputError, nearest_name
from texproj.files import json_hash, staging
from texproj.formats.cameras import camera_part
from texproj.photo import Photo
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.resources.scratch import Scratch
from texproj.stages.attending import INTERNAL, NO_MEMORY, attended
from texproj.stages.bench import Workbench
from texproj.stages.checking import checker_of, checker_path
from texproj.stages.freshness import (
    Freshness,
    Inputs,
    changed_inputs,
    file_inputs,
    options_inputs,
)
from texproj.stages.layouts import (
    filled_from_mesh,
    layout_inputs,
    layout_notes,
    mesh_to_fill,
)
from texproj.stages.occluding import keep_occluders, occluder_inputs, occluders_sought
from texproj.stages.outcomes import Tally
from texproj.stages.progress import Progress, silent
from texproj.stages.provenance import provenance_of

if TYPE_CHECKING:
    from texproj.color.checker.fit import Checker
    from texproj.color.result import Texture, VertexColors
    from texproj.color.sampling.photo_set import PhotoSet
    from texproj.stages.writing import OutputPlan

    Write: TypeAlias = Callable[[Path, OutputPlan], tuple[str, ...]]

STAGE = "color"
VERSION = 4
DOUBTFUL = 0.6
"""Part of what a photo shows of the piece beyond which contradiction is as likely its camera's."""
TOLD_BEHIND = 0.15
"""Right meshes show 1 to 6 % backs, through holes and at thin parts (fountain-P11, the stele)."""
SECTIONS = ("color", "unwrap", "patches", "output", "render")


@dataclass(frozen=True, eq=False)
class ColorOutcome:
    """What was written, from which photos, and which could not be used and why.

    folder: where the files are; notes: what of the inputs is not used as one might think; kept:
    nothing had changed since the last run, so nothing was done.
    """

    folder: Path
    files: tuple[str, ...]
    used: tuple[str, ...]
    failed: dict[str, str]
    quality: dict[str, Any]
    notes: tuple[str, ...]
    kept: bool

    @property
    def tally(self) -> Tally:
        return Tally(len(self.failed), len(self.failed) + len(self.used), "used")

    def lines(self) -> Iterator[str]:
        """For people."""
        state = "fresh, kept" if self.kept else "wrote"
        yield f"{state}: {', '.join(str(self.folder / name) for name in self.files)}"
        chart = self.quality.get("checker")
        if chart:
            before, after = (chart["ciede2000"][when]["median"] for when in ("before", "after"))
            yield (
                f"color chart {chart['file']}: CIEDE2000 of its patches"
                f" {before:.1f} -> {after:.1f}; exposure: {chart['exposure']}"
            )
        for note in self.notes:
            yield f"note: {note}"
        for name, reason in self.failed.items():
            yield f"{name}: FAILED: {reason}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {**vars(self), "folder": str(self.folder)}


def color_project(bench: Workbench, progress: Progress = silent) -> ColorOutcome:
    """Color the mesh from all registered photos and write the model to out/.

    A photo that cannot be read is left out and named in `failed`. Raises InputError if none is
    left, OutputError if out/ cannot be written; the old model stays then.
    """
    project = bench.project
    before = project.load_record(STAGE)
    if before is not None and color_freshness(project).fresh:
        return _outcome(project, before, kept=True)
    from texproj.stages.lightening import check_levels  # noqa: PLC0415 - slow to load
    from texproj.stages.writing import output_plan  # noqa: PLC0415

    cameras, failed = usable_cameras(project)
    measured = [project.photo_info(name).up_in_cam for name in cameras]
    wanted = project.settings.color, project.settings.output
    plan = output_plan(*wanted, tuple(cameras.values()), measured)
    check_levels(project.settings.color, project.settings.output)
    notes = layout_notes(bench)
    with closing(Scratch()) as scratch:
        kept = keep_occluders(bench, cameras, progress, scratch)
        inputs = _inputs(project)
        photos = replace(photo_set(project, cameras), depths=kept.depths)
        colors, write = _made(bench, _projected_by_crew(bench, photos), progress)
    failed |= colors.failed
    if not set(cameras) - set(failed):
        raise InputError(f"no photo could be read: {'; '.join(failed.values())}")
    if not colors.quality["seen"]:
        raise InputError(
            f"no photo shows any of the mesh; masks may leave out all of it: look into"
            f" {project.root / 'masks'}, and at the cameras (`texproj preview`)"
        )
    used = [name for name in cameras if name not in failed]
    made_by = provenance_of(project, used)
    with staging(project.out) as folder:
        files = write(folder, replace(plan, provenance=made_by))
    remove_leftovers(project, before, files)
    record = {
        "inputs": inputs,
        "outputs": {name: project.hash_of(project.out / name) for name in files},
        "used": used,
        "failed": failed,
        "quality": colors.quality,
        "occluders": kept.hidden,
        "standing": asdict(plan.standing),
        "provenance": dict(made_by.facts),
        "copyright": made_by.copyright,
        "mesh notes": [*bench.source.notes, *notes, *getattr(colors, "notes", ())],
    }
    project.save_record(STAGE, None, record)
    project.save_hashes()
    return _outcome(project, record, kept=False)


def remove_leftovers(project: Project, before: Any, files: tuple[str, ...]) -> None:
    """Delete what the run before wrote and this one did not, unless somebody changed it since."""
    for name, known in (before or {}).get("outputs", {}).items():
        path = project.out / Path(name).name
        if path.name in files or project.hash_of(path) != known:
            continue
        try:
            path.unlink()
        except OSError as error:
            raise OutputError(
                f"{path} of an earlier run cannot be removed: {error.strerror}"
            ) from None


def color_freshness(project: Project) -> Freshness:
    """Whether the model in out/ is what the project's inputs give."""
    record = project.load_record(STAGE)
    reason = changed_inputs(record, _inputs(project), project.settings.exclude)
    if record is not None and not reason:
        faults = [n for n, why in record.get("failed", {}).items() if why in (INTERNAL, NO_MEMORY)]
        reason = f"{', '.join(faults)} met an internal fault, which may be gone" if faults else ""
    if record is not None and not reason:
        reason = changed_outputs(project, record)
    return Freshness(STAGE, project.settings.color.to, not reason, reason)


def changed_outputs(project: Project, record: Mapping[str, Any]) -> str:
    """Which files that a stage wrote are not as it wrote them; empty if all are."""
    written = record.get("outputs", {})
    gone = [n for n, known in written.items() if project.hash_of(project.out / n) != known]
    return f"{', '.join(gone)} changed or missing in {project.out}" if gone else ""


def usable_cameras(project: Project) -> tuple[dict[str, Camera], dict[str, str]]:
    """The cameras that color can use by photo name, and why others that claim one cannot.

    Raises InputError if no photo is registered.
    """
    cameras, failed = {}, {}
    for name, record in project.load_cameras().items():
        if record.registered_camera is None:
            continue
        if name in project.settings.exclude:
            continue
        if name not in project.photo_paths:
            failed[name] = (
                f"{project.cameras_path} names {name!r}, which is not in "
                f"{project.root / project.settings.photos}{nearest_name(name, project.photo_paths)}"
            )
            continue
        if other := _other_shape(project, record):
            failed[name] = other
            continue
        cameras[name] = record.registered_camera
    if failed and not cameras:
        raise InputError("; ".join(failed.values()))
    if not cameras:
        hint = f"run `texproj register {project.root}` first"
        raise InputError(f"no photo of {project.root} is registered; {hint}")
    return cameras, failed


def _other_shape(project: Project, record: CameraRecord) -> str:
    """Why the camera cannot be this photo's: its width and height have another ratio."""
    try:
        info = project.photo_info(record.file)
    except InputError as error:
        return str(error)
    difference = abs(record.width * info.height - record.height * info.width)
    if difference <= max(info.width, info.height) + max(record.width, record.height):
        return ""  # the same picture, maybe of another size, its sides rounded
    return (
        f"{project.cameras_path} says that {record.file} has {record.width} x {record.height}"
        f" pixels, and upright it has {info.width} x {info.height}; register it again"
    )


def photo_set(project: Project, cameras: Mapping[str, Camera]) -> PhotoSet:
    """The photos of these cameras, without what stands in front of the piece."""
    from texproj.color.sampling.photo_set import PhotoSet  # noqa: PLC0415 - slow to load

    cut = occluders_sought(project)

    def read(name: str) -> Photo:
        return attended(name, partial(project.load_photo, name, cut=cut))

    return PhotoSet(tuple(cameras), tuple(cameras.values()), read)


def _projected_by_crew(bench: Workbench, photos: PhotoSet) -> PhotoSet:
    """The photos, which the workers of a cluster project, if one was asked for."""
    if bench.crew is None:
        return photos
    from texproj.stages.projection_tasks import ProjectionByCrew  # noqa: PLC0415 - slow to load

    return replace(photos, elsewhere=ProjectionByCrew(bench.crew, bench.project))


def _made(
    bench: Workbench, photos: PhotoSet, progress: Progress
) -> tuple[VertexColors | Texture, Write]:
    """The colors of the model, and what writes it into a folder and returns the file names."""
    from texproj.color.vertices import color_vertices  # noqa: PLC0415 - slow to load
    from texproj.stages.lightening import levels_of, told_of_levels, write_levels  # noqa: PLC0415
    from texproj.stages.writing import write_texture, write_vertices  # noqa: PLC0415

    def tell(done: int, total: int) -> None:
        progress(STAGE, done, total, "")

    options, checker = bench.project.settings.color, checker_of(bench.project)
    if options.to == "vertices":
        colors = color_vertices(bench.mesh, photos, bench.renderer, options, checker, tell)
        return colors, lambda folder, plan: write_vertices(folder, bench.source, colors, plan)
    texture = _texture(bench, photos, checker, tell)
    if bench.project.settings.output.faces:
        levels = levels_of(bench, texture)
        texture = told_of_levels(texture, levels, len(bench.mesh.faces))
        return texture, lambda folder, plan: write_levels(folder, levels, plan)
    return texture, lambda folder, plan: write_texture(folder, bench.mesh, texture, plan)


def _texture(
    bench: Workbench, photos: PhotoSet, checker: Checker | None, tell: Callable[[int, int], None]
) -> Texture:
    from texproj.color.patches.texture import PatchSettings, color_patches  # noqa: PLC0415 - slow to load
    from texproj.color.texture import color_texture  # noqa: PLC0415

    settings, given = bench.project.settings, (mesh_to_fill(bench), photos, bench.renderer)
    if settings.color.to == "patches":
        patches = PatchSettings(settings.color, settings.patches, settings.unwrap)
        texture = color_patches(*given, patches, checker, tell)
    else:
        texture = color_texture(*given, settings.color, settings.unwrap, checker, tell)
    return filled_from_mesh(bench, texture)


def _inputs(project: Project) -> Inputs:
    settings = options_inputs(project, VERSION, *SECTIONS)
    return {**settings, **seen_inputs(project), **layout_inputs(project)}


def seen_inputs(project: Project) -> Inputs:
    """Mesh, color chart, photos, masks and cameras: all that colors are made from but settings."""
    chart = checker_path(project)
    records = {n: r for n, r in project.load_cameras().items() if n in project.photo_paths}
    return {
        **file_inputs(project, mesh=project.mesh_path),
        **({"color chart": project.hash_of(chart) or "none"} if chart else {}),
        **{k: v for n, r in records.items() for k, v in _photo_inputs(project, n, r).items()},
    }


def _photo_inputs(project: Project, name: str, record: CameraRecord) -> Inputs:
    if record.registered_camera is None:
        return {}
    camera = {"width": record.width, "height": record.height, **camera_part(record)}
    files = {name: project.photo_path(name), f"mask of {name}": project.mask_files(name)}
    hidden = occluder_inputs(project, name)
    return {**file_inputs(project, **files), **hidden, f"camera of {name}": json_hash(camera)}


def _left_out(name: str, told: dict[str, Any]) -> str:
    """The sentence about what stands in front of the piece in a photo."""
    if told["edited"]:
        return f"{name}: {told['mask']}, which was edited, says what is left out of it"
    doubt = ", or its camera is wrong," if told["share"] > DOUBTFUL else ""
    return (
        f"{name}: something stands in front of the piece{doubt} ({100 * told['share']:.1f} % of"
        f" what the photo shows of it) and is left out; {told['mask']} shows what, and can be"
        " edited"
    )


def _turned(quality: dict[str, Any]) -> tuple[str, ...]:
    """The sentence about a mesh of which many faces look away from the photos."""
    behind = quality.get("behind", 0.0)
    if behind < TOLD_BEHIND:
        return ()
    return (
        f"{behind:.0%} of what the photos see of the mesh is the back of its faces, which gets no"
        " color; turn these over (MeshLab: Filters, Normals, Re-Orient All Faces Coherently)",
    )


def _outcome(project: Project, record: dict[str, Any], kept: bool) -> ColorOutcome:
    files, used = tuple(record["outputs"]), tuple(record["used"])
    hidden = record.get("occluders", {})
    failed, quality = record["failed"], record["quality"]
    left_out = (_left_out(n, told) for n, told in hidden.items())
    notes = (*record.get("mesh notes", ()), *_turned(quality), *left_out)
    return ColorOutcome(project.out, files, used, failed, quality, notes, kept)
