"""Pictures of what each photo counts for, where, and why: out/factors/."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.color.factors import FACTORS, Inspection, photo_factors
from texproj.color.points.pixels import PixelPoints
from texproj.color.points.source import VertexPoints
from texproj.color.sampling.depth_images import Depths
from texproj.color.sampling.resolution import texels_per_unit
from texproj.errors import InputError
from texproj.files import staging
from texproj.report.factors import factor_image, factor_sheet
from texproj.resources.scratch import Scratch
from texproj.stages.bench import Workbench
from texproj.stages.checking import color_options
from texproj.stages.coloring import Photos, usable_cameras
from texproj.stages.progress import Progress, silent

STAGE = "factors"
BATCH = 8
"""Photos whose pixels are looked at together; each batch decodes all photos once."""
SHEET = "overview.jpg"

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
        looker = _Looker(bench, cameras, Photos(project, list(cameras), failed), scratch)
        for number, batch in enumerate(batches):

            def tell(done: int, total: int, number: int = number) -> None:
                progress(STAGE, number * total + done, len(batches) * total, "")

            for name, images in looker.look(batch, longest, tell).items():
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
    cameras, failed = usable_cameras(bench.project)
    if name not in cameras:
        raise InputError(f"{name} is not registered, so it counts nowhere")
    with closing(Scratch()) as scratch:
        looker = _Looker(bench, cameras, Photos(bench.project, list(cameras), failed), scratch)

        def tell(done: int, total: int) -> None:
            progress(STAGE, done, total, "")

        return looker.look_at_vertices(name, tell)


class _Looker:
    """Looks at the factors of some photos, with what all of them need."""

    def __init__(
        self, bench: Workbench, cameras: dict[str, Camera], photos: Photos, scratch: Scratch
    ) -> None:
        self._bench, self._photos, self._scratch = bench, photos, scratch
        self._names, self._cameras = list(cameras), list(cameras.values())
        self._options = color_options(bench.project, self._names)
        self._depths = Depths.of(self._cameras, bench.plain_scene, self._options, scratch)
        density = texels_per_unit(bench.mesh, self._cameras, self._depths, self._options)
        self._spacing = 1 / np.maximum(density, np.finfo(np.float32).tiny)

    def look(self, batch: Sequence[int], longest: int, tell: Tell) -> dict[str, Images]:
        """The factors of the photos of those numbers as images, nan where the mesh is not."""
        frames = [self._cameras[number] for number in batch]
        small = [c.scaled(min(1.0, longest / max(c.width, c.height))) for c in frames]
        points = PixelPoints.of(self._bench.mesh, self._bench.plain_scene, small, self._spacing)
        job = Inspection(
            points, self._cameras, self._photos, self._depths, self._options, self._scratch
        )
        seeing = {number: [k] for k, number in enumerate(batch) if points.sizes[k]}
        found = photo_factors(job, seeing, tell)
        blind: dict[str, Images] = {self._names[n]: {} for n in batch if n not in seeing}
        return blind | {
            self._names[number]: {
                name: points.image(batch.index(number), values) for name, values in factors.items()
            }
            for number, factors in found.items()
        }

    def look_at_vertices(self, name: str, tell: Tell) -> Images:
        """(V,) factors of one photo; detail is compared as finely as for a texture."""
        points, faces = VertexPoints.of(self._bench.mesh), self._bench.mesh.faces
        if self._options.to != "vertices":
            count = len(points.owners.center)
            around = np.bincount(faces.ravel(), np.repeat(self._spacing, 3), count)
            spacing = around / np.maximum(np.bincount(faces.ravel(), minlength=count), 1)
            owners = replace(points.owners, spacing=spacing.astype(np.float32))
            points = VertexPoints(owners)
        job = Inspection(
            points, self._cameras, self._photos, self._depths, self._options, self._scratch
        )
        number = self._names.index(name)
        found = photo_factors(job, {number: range(len(points.sizes))}, tell).get(number)
        if found is None:
            raise InputError(self._photos.failed[name])
        return {k: np.where(found["weight"] > 0, v, np.float32(0)) for k, v in found.items()}


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
        sheet = factor_sheet(photo, images, FACTORS)[..., ::-1]
        (folder / SHEET).write_bytes(cv2.imencode(".jpg", sheet)[1].tobytes())
    return target
