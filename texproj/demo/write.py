"""The synthetic project on disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import trimesh

from texproj.demo.make import DemoProject, make_demo
from texproj.formats.cameras import cameras_json
from texproj.formats.correspondences import correspondences_csv
from texproj.mesh import Mesh
from texproj.options import DemoOptions
from texproj.photo import srgb_from_linear


def write_demo(
    folder: Path,
    options: DemoOptions | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> DemoProject:
    """Make the demo and write it as a project folder plus `truth/`: the true cameras, the true
    colors of the scan's vertices (albedo.ply, shaded.ply) and the piece's outline in each photo.
    """
    demo = make_demo(options or DemoOptions(), progress)
    for name in ("mesh", "photos", "correspondences", "truth/masks"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "mesh/scan.ply").write_bytes(_ply(demo.mesh))
    (folder / "cameras.json").write_text(cameras_json(demo.starts), "utf-8")
    for photo in demo.photos:
        (folder / "photos" / photo.file).write_bytes(photo.encoded)
        stem = Path(photo.file).stem
        mask = cv2.imencode(".png", photo.object_mask)[1].tobytes()
        (folder / "truth/masks" / f"{stem}.png").write_bytes(mask)
        if photo.picks is not None:
            picks = correspondences_csv(photo.picks)
            (folder / "correspondences" / f"{stem}.csv").write_text(picks, "utf-8")
    _write_truth(folder / "truth", demo)
    return demo


def _write_truth(folder: Path, demo: DemoProject) -> None:
    (folder / "cameras.json").write_text(cameras_json(demo.truth), "utf-8")
    for name, linear in (("albedo", demo.albedo), ("shaded", demo.shaded)):
        rgb = np.round(srgb_from_linear(linear) * 255).astype(np.uint8)
        (folder / f"{name}.ply").write_bytes(_ply(demo.mesh, rgb))


def _ply(mesh: Mesh, rgb: np.ndarray | None = None) -> bytes:
    model = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=rgb, process=False)
    return bytes(model.export(file_type="ply"))
