"""Pictures of what each photo counts for, where, and why: out/factors/."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.color.factors import Inspection, photo_factors
from texproj.color.points.pixels import PixelPoints
from texproj.color.points.source import PointSource, VertexPoints
from texproj.color.sampling.photo_set import PhotoSet, reasons
from texproj.color.sampling.resolution import texels_per_unit
from texproj.color.weights.names import FACTORS
from texproj.errors import InputError
from texproj.files import staging
from texproj.formats.jpeg import jpeg_bytes
from texproj.report.factors import factor_image, factor_sheet
from texproj.resources.scratch import Scratch
from texproj.stages.bench import Workbench
from texproj.stages.coloring import photo_set, usable_cameras
from texproj.stages.outcomes import Tally
from texproj.stages.progress import Progress, silent

STAGE = "factors"
BATCH = 8
"""Photos whose pixels are looked at together; each batch decodes all photos once."""
SHEET, SHEET_QUALITY = "overview.jpg", 95

Tell = Callable[[int, int], None]
Images = dict[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class InspectionOutcome:
    """The folders that were written, by photo, and the mean of each factor where the photo shows
    the mesh; failed: photos that could not be read, and why.
    """

    folders: dict[str, Path]
    means: dict[str, dict[str, float]]
    failed: dict[str, str]

    @property
    def tally(self) -> Tally:
        return Tally(len(self.failed), len(self.failed) + len(self.folders), "shown")

    def lines(self) -> Iterator[str]:
        """For people."""
        for name, path in self.folders.items():
            told = ", ".join(f"{factor} {mean:.2f}" for factor, mean in self.means[name].items())
            yield f"{name}: wrote {path} (means: {told})"
        for name, reason in self.failed.items():
            yield f"{name}: FAILED: {reason}"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {**vars(self), "folders": {name: str(path) for name, path in self.folders.items()}}


def inspect_project(
    bench: Workbench, names: Sequence[str], longest: int, progress: Progress = silent
) -> InspectionOutcome:
    """Write for each of the photos an image of every factor in its own frame, and a sheet of all.

    longest: longer side of the images, pixels. Raises InputError if none of the photos is
    registered, OutputError if out/ cannot be written.
    """
    project = bench.project
    project.check_writable(project.out)
    cameras, failed = usable_cameras(project)
    chosen = [number for number, name in enumerate(cameras) if name in set(names)]
    if not chosen:
        raise InputError(f"none of the chosen photos of {project.root} is registered")
    batches = [chosen[k : k + BATCH] for k in range(0, len(chosen), BATCH)]
    outcome = InspectionOutcome({}, {}, failed)
    with closing(Scratch()) as scratch:
        looker = _Looker(bench, photo_set(project, cameras), scratch)
        for number, batch in enumerate(batches):

            def tell(done: int, total: int, number: int = number) -> None:
                progress(STAGE, number * total + done, len(batches) * total, "")

            found, unread = looker.look(batch, longest, tell)
            failed |= unread
            for name, images in found.items():
                if not images:
                    failed[name] = "sees nothing of the mesh"
                    continue
                outcome.folders[name] = _written(bench, name, images)
                outcome.means[name] = {k: float(np.nanmean(v)) for k, v in images.items()}
    return outcome


def vertex_factors(
    bench: Workbench, name: str, progress: Progress = silent
) -> dict[str, NDArray[np.float32]]:
    """(V,) factors of a photo at the vertices of the mesh by name, 0 where it does not see them.

    Raises InputError if the photo is not registered.
    """
    cameras, _ = usable_cameras(bench.project)
    if name not in cameras:
        raise InputError(f"{name} is not registered, so it counts nowhere")
    with closing(Scratch()) as scratch:
        looker = _Looker(bench, photo_set(bench.project, cameras), scratch)

        def tell(done: int, total: int) -> None:
            progress(STAGE, done, total, "")

        return looker.look_at_vertices(name, tell)


class _Looker:
    """Looks at the factors of some photos, with what all of them need."""

    def __init__(self, bench: Workbench, photos: PhotoSet, scratch: Scratch) -> None:
        self._bench, self._scratch = bench, scratch
        self._options = bench.project.settings.color
        self._photos = photos.rendered(bench.plain_scene, scratch)
        density = texels_per_unit(bench.mesh, self._photos, self._options)
        self._spacing = 1 / np.maximum(density, np.finfo(np.float32).tiny)

    def look(
        self, batch: Sequence[int], longest: int, tell: Tell
    ) -> tuple[dict[str, Images], dict[str, str]]:
        """The factors of the photos of those numbers as images, nan where the mesh is not; and why
        photos could not be read.
        """
        small = [self._photos.cameras[number].reduced(longest) for number in batch]
        points = PixelPoints.of(self._bench.mesh, self._bench.plain_scene, small, self._spacing)
        seeing = {number: [k] for k, number in enumerate(batch) if points.sizes[k]}
        found, failed = photo_factors(self._inspection(points), seeing, tell)
        names = self._photos.names
        blind: dict[str, Images] = {names[n]: {} for n in batch if n not in seeing}
        images = {
            names[number]: {
                name: points.image(batch.index(number), values) for name, values in factors.items()
            }
            for number, factors in found.items()
        }
        return blind | images, reasons(failed)

    def look_at_vertices(self, name: str, tell: Tell) -> Images:
        """(V,) factors of one photo; detail is compared as finely as for a texture. Raises
        InputError if it cannot be read.
        """
        points, faces = VertexPoints.of(self._bench.mesh), self._bench.mesh.faces
        if self._options.to != "vertices":
            count = len(points.owners.center)
            around = np.bincount(faces.ravel(), np.repeat(self._spacing, 3), count)
            spacing = around / np.maximum(np.bincount(faces.ravel(), minlength=count), 1)
            owners = replace(points.owners, spacing=spacing.astype(np.float32))
            points = VertexPoints(owners)
        number, chunks = self._photos.names.index(name), range(len(points.sizes))
        factors, failed = photo_factors(self._inspection(points), {number: chunks}, tell)
        if number not in factors:
            raise InputError(reasons(failed)[name])
        found = factors[number]
        return {k: np.where(found["weight"] > 0, v, np.float32(0)) for k, v in found.items()}

    def _inspection(self, points: PointSource) -> Inspection:
        return Inspection(points, self._photos, self._options, self._scratch)


def _written(bench: Workbench, name: str, images: Images) -> Path:
    """Write the images of a photo; returns their folder."""
    target = bench.project.factors_path(name)
    height, width = next(iter(images.values())).shape
    photo = bench.project.load_photo(name, max(height, width))
    with staging(target) as folder:
        for factor, values in images.items():
            gray, alpha = cv2.split(factor_image(values))
            image = cv2.merge([gray, gray, gray, alpha])
            (folder / f"{factor}.png").write_bytes(cv2.imencode(".png", image)[1].tobytes())
        sheet = factor_sheet(photo, images, FACTORS)
        (folder / SHEET).write_bytes(jpeg_bytes(sheet, SHEET_QUALITY))
    return target
