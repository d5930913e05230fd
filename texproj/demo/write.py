"""The synthetic project on disk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.demo.lamps import DemoSize, make_lit_demo
from texproj.demo.make import DemoPhoto, DemoProject, make_demo
from texproj.files import staging, write_atomically
from texproj.formats.cameras import cameras_json
from texproj.formats.correspondences import correspondences_csv
from texproj.formats.models.ply import write_ply
from texproj.mesh import Mesh
from texproj.options import DemoLight, DemoOptions
from texproj.photo import srgb_from_linear
from texproj.records import CameraRecord


def write_demo(
    folder: Path,
    options: DemoOptions | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> DemoProject:
    """Make the demo and write it as a project folder plus `truth/`: the true cameras, the true
    colors of the scan's vertices (albedo.ply, shaded.ply) and the piece's outline in each photo.

    progress: called with a word on each step. Raises OutputError.
    """
    demo = make_demo(options or DemoOptions(), progress)
    _write(folder, demo, demo.starts)
    return demo


def write_lit_demo(
    folder: Path,
    light: DemoLight,
    size: DemoSize | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> DemoProject:
    """The same of a piece whose light is to be found; its cameras are given, as they are."""
    demo = make_lit_demo(light, size, progress)
    _write(folder, demo, demo.truth)
    return demo


def _write(folder: Path, demo: DemoProject, cameras: Sequence[CameraRecord]) -> None:
    """Files of the project; cameras: what is known of them in advance."""
    for photo in demo.photos:
        _write_photo(folder, photo)
    truth = folder / "truth"
    write_atomically(truth / "cameras.json", cameras_json(demo.truth))
    _write_ply(truth / "albedo.ply", demo.mesh, _encoded(demo.albedo))
    _write_ply(truth / "shaded.ply", demo.mesh, _encoded(demo.shaded))
    _write_ply(folder / "mesh/scan.ply", demo.mesh, None)
    if cameras:
        write_atomically(folder / "cameras.json", cameras_json(cameras))


def _write_photo(folder: Path, photo: DemoPhoto) -> None:
    """The picture, its picks if it has any, and the piece's outline."""
    stem = Path(photo.file).stem
    write_atomically(folder / "photos" / photo.file, photo.encoded)
    outline = cv2.imencode(".png", photo.object_mask)[1].tobytes()
    write_atomically(folder / "truth/masks" / f"{stem}.png", outline)
    if photo.picks is not None:
        picks = correspondences_csv(photo.picks)
        write_atomically(folder / "correspondences" / f"{stem}.csv", picks)


def _write_ply(path: Path, mesh: Mesh, colors: NDArray[np.uint8] | None) -> None:
    with staging(path.parent) as place:
        write_ply(place / path.name, mesh.vertices, mesh.faces, colors)


def _encoded(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.round(srgb_from_linear(linear) * 255).astype(np.uint8)
