"""Per-vertex values that the page shows in place of colors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.errors import TexprojError
from texproj.options import ColorOptions
from texproj.photo import srgb_from_linear
from texproj.records import CameraRecord
from texproj.stages.bench import Workbench
from texproj.stages.progress import Progress

Values = NDArray[np.float32]
UNSEEN = np.float32(-1)
LONGEST = 1600
"""Longer side of the photos whose weights are shown, pixels: the layers are looked at, not used."""


def occlusion_layer(bench: Workbench, progress: Progress) -> Values:
    """(V,) ambient occlusion, 0 hidden .. 1 open."""
    progress("ambient occlusion", 0, 1, "")
    return bench.occlusion.astype(np.float32)


def photo_layers(bench: Workbench, progress: Progress) -> dict[str, Values]:
    """How many photos see each vertex, and the number of the photo with the largest weight there.

    coverage: (V,) count; source: (V,) index into the project's photo names, -1 = unseen.
    """
    count = len(bench.mesh.vertices)
    coverage = np.zeros(count, np.float32)
    best, source = np.zeros(count, np.float32), np.full(count, UNSEEN)
    names = registered_names(bench)
    numbers = {name: k for k, name in enumerate(bench.project.photo_names)}
    for done, name in enumerate(names):
        progress("coverage", done, len(names), name)
        weights = weights_of(bench, name)
        coverage += weights > 0
        better = weights > best
        best[better], source[better] = weights[better], numbers[name]
    return {"coverage": coverage, "source": source}


def weights_layer(bench: Workbench, progress: Progress, name: str) -> Values:
    """(V,) weight of one photo, 0 = does not see the vertex, 1 = best. Raises TexprojError."""
    progress("weights", 0, 1, name)
    return weights_of(bench, name)


def factor_layers(bench: Workbench, progress: Progress, name: str) -> dict[str, Values]:
    """(V,) each factor of one photo by name, 0 where it does not see the vertex; without a mask
    nothing is masked. Raises TexprojError.
    """
    from texproj.stages.inspecting import vertex_factors  # noqa: PLC0415 - slow to import

    found = vertex_factors(bench, name, progress)
    return {"mask": (found["weight"] > 0).astype(np.float32), **found}


def mean_layer(bench: Workbench, progress: Progress) -> NDArray[np.uint8]:
    """(V, 4) uint8 sRGB of the plain weighted mean of all photos, and 255 (0 = unseen). Raises
    TexprojError.
    """
    from texproj.color.vertices import color_vertices  # noqa: PLC0415 - slow to import
    from texproj.stages.coloring import photo_set, usable_cameras  # noqa: PLC0415

    cameras, _ = usable_cameras(bench.project)
    if not cameras:
        raise TexprojError("no photo is registered, so there is nothing to average")
    plain = ColorOptions(blend="mean", focus_power=0, vignetting="off")
    photos = photo_set(bench.project, cameras)
    found = color_vertices(
        bench.mesh, photos, bench.renderer, plain, None,
        lambda done, total: progress("color", done, total, ""),
    )  # fmt: skip
    rgba = np.zeros((len(found.rgb), 4), np.uint8)
    rgba[:, :3] = np.round(srgb_from_linear(np.clip(found.rgb, 0, 1)) * 255)
    rgba[:, 3] = np.where(found.weight > 0, 255, 0)
    return rgba


def registered_names(bench: Workbench) -> list[str]:
    """The photos that color uses."""
    entries = bench.project.load_cameras()
    done = {name for name, record in entries.items() if usable_camera(record) is not None}
    return [name for name in bench.project.photo_names if name in done]


def usable_camera(record: CameraRecord | None) -> Camera | None:
    """The camera of an entry that color may use: registered, with pose and intrinsics."""
    return record.camera if record is not None and record.status == "registered" else None


def weights_of(bench: Workbench, name: str) -> Values:
    """(V,) weight of each vertex in one photo, as the color stage computes it."""
    from texproj.preview.sight import vertex_weights  # noqa: PLC0415 - slow to import

    camera = usable_camera(bench.project.load_cameras().get(name))
    if camera is None:
        raise TexprojError(f"{name} is not registered, so it has no weights")
    photo = bench.project.load_photo(name, LONGEST)
    return vertex_weights(bench, photo, camera)
