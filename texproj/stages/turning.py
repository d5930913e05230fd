"""A film of the colored model on a turntable: out/turntable.gif, .webp, or pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

from texproj.arrays import Bytes
from texproj.errors import InputError, UsageError
from texproj.files import staging
from texproj.project import Project
from texproj.render import ModelLook, model_pictures
from texproj.report.pictures import around, on_backdrop
from texproj.stages.bench import Workbench
from texproj.stages.coloring import STAGE as COLOR
from texproj.stages.coloring import remove_leftovers
from texproj.stages.depicting import written_model
from texproj.stages.film_path import film_path
from texproj.stages.fronts import front
from texproj.stages.outcomes import Tally
from texproj.stages.progress import Progress, silent

STAGE = "turntable"
Film = Literal["webp", "gif", "png"]
WEBP_QUALITY = 85
BACKS = 0.03
"""Linear gray of the backs of faces: nobody takes them for the surface."""
PALETTE_FRAMES = 8
"""From so many frames the 256 colors of a gif are chosen."""
MOST_FRAMES, LARGEST = 720, 2160
MOST_PIXELS = 400_000_000
"""Of all frames together: 1.2 GB."""
GIF_STEP_MS, GIF_LEAST_MS = 10, 20
"""GIF counts time in such steps; browsers slow down frames that are shorter."""


@dataclass(frozen=True)
class TurntableOptions:
    """film: webp (small, full color), gif (256 colors, shown everywhere) or png (one picture a
    frame); frames: pictures of one turn; seconds: of one turn; size: width and height, pixels.
    Raises UsageError for what cannot be made.
    """

    film: Film = "webp"
    frames: int = 72
    seconds: float = 6.0
    size: int = 640

    def __post_init__(self) -> None:
        if not 2 <= self.frames <= MOST_FRAMES:
            raise UsageError(f"--frames {self.frames} is not between 2 and {MOST_FRAMES}")
        if not 16 <= self.size <= LARGEST:
            raise UsageError(f"--size {self.size} is not between 16 and {LARGEST} pixels")
        if not 0.1 <= self.seconds <= 600:
            raise UsageError(f"--seconds {self.seconds:g} is not between 0.1 and 600")
        if self.frames * self.size**2 > MOST_PIXELS:
            raise UsageError(
                f"{self.frames} frames of {self.size} x {self.size} pixels do not fit into memory;"
                " lower --frames or --size"
            )


@dataclass(frozen=True)
class TurntableOutcome:
    """The files that were written; notes: what is unusual about the film."""

    files: tuple[Path, ...]
    notes: tuple[str, ...]

    @property
    def tally(self) -> Tally:
        return Tally(0, len(self.files), "written")

    def lines(self) -> Iterator[str]:
        """For people."""
        first, last = self.files[0], self.files[-1]
        yield f"wrote {first}" + (f" to {last.name}" if last != first else "")
        for note in self.notes:
            yield f"note: {note}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {"files": [str(path) for path in self.files], "notes": list(self.notes)}


def turn_project(
    bench: Workbench, options: TurntableOptions, progress: Progress = silent
) -> TurntableOutcome:
    """Render the model of the project once around, or to and fro where it is open at its back. It
    begins at the front, with up as in the photos; backs of faces are dark. Pictures of a longer
    film before go. Raises InputError where there is no model yet, or one of another mesh,
    OutputError.
    """
    project = bench.project
    written = written_model(project)
    if written.model is None:
        why = "".join(f"; {note}" for note in written.notes)
        raise InputError(
            f"{project.root} has no model that can be shown; run `texproj color {project.root}`"
            + why
        )
    need_same_mesh(project, COLOR, "it was colored", f"`texproj color {project.root}`")
    project.check_writable(project.out)
    before = front(project, bench.mesh)
    path = film_path(bench, before, options.frames)
    angles, of_frame = np.unique(path.angles_deg.round(6), return_inverse=True)
    views = around(bench.mesh, before, angles.tolist(), (options.size, options.size))
    look = ModelLook(backs=BACKS if path.sided else None)
    shown = []
    for picture in model_pictures(bench.renderer, written.model, views, look):
        shown.append(on_backdrop(picture))
        progress(STAGE, len(shown), len(views), "")
    with staging(project.out) as folder:
        names = write_film(folder, [shown[k] for k in of_frame], options)
    replace_record(project, STAGE, options.film, names)
    notes = (*written.notes, *((path.note,) if path.note else ()))
    return TurntableOutcome(tuple(project.out / name for name in names), notes)


def need_same_mesh(project: Project, stage: str, made: str, work: str) -> None:
    """Raise InputError if the mesh has changed since a stage: what it made is not where the cameras
    and the views are. made, work: words for what was done, and what to do.
    """
    inputs = (project.load_record(stage) or {}).get("inputs", {})
    if inputs.get("mesh") != project.hash_of(project.mesh_path):
        raise InputError(f"{project.mesh_path} has changed since {made}; run {work}")


def replace_record(project: Project, stage: str, film: str, names: Sequence[str]) -> None:
    """Remember the files of a film or picture, and remove those of an earlier one of the kind that
    it has not; what somebody changed stays.
    """
    known = (project.load_record(stage) or {}).get("outputs", {})
    mine = {name: key for name, key in known.items() if name.endswith(f".{film}")}
    remove_leftovers(project, {"outputs": mine}, tuple(names))
    others = {name: key for name, key in known.items() if name not in mine}
    now = {name: project.hash_of(project.out / name) for name in names}
    project.save_record(stage, None, {"inputs": {}, "outputs": others | now})


def write_film(
    folder: Path, frames: Sequence[Bytes], options: TurntableOptions, stem: str = STAGE
) -> list[str]:
    """Write (h, w, 3) sRGB frames as one file, or as one each; returns the names."""
    if options.film == "png":
        digits = max(3, math.ceil(math.log10(len(frames) + 1)))
        names = [f"{stem}_{k:0{digits}}.png" for k in range(len(frames))]
        for name, frame in zip(names, frames, strict=True):
            encoded = cv2.imencode(".png", cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))[1]
            (folder / name).write_bytes(encoded.tobytes())
        return names
    from PIL import Image  # noqa: PLC0415 - slow to load

    name = f"{stem}.{options.film}"
    pictures = [Image.fromarray(np.ascontiguousarray(frame)) for frame in frames]
    times: dict[str, Any] = {"duration": 1000 * options.seconds / len(frames), "loop": 0}
    if options.film == "gif":
        some = np.vstack(frames[:: max(1, len(frames) // PALETTE_FRAMES)])
        palette = Image.fromarray(some).quantize(256, dither=Image.Dither.NONE)
        pictures = [p.quantize(palette=palette) for p in pictures]
        steps = round(times["duration"] / GIF_STEP_MS)
        times["duration"] = max(GIF_LEAST_MS, steps * GIF_STEP_MS)
    else:
        times |= {"quality": WEBP_QUALITY, "method": 4, "duration": round(times["duration"])}
    pictures[0].save(folder / name, save_all=True, append_images=pictures[1:], **times)
    return [name]
