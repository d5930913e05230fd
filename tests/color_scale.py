"""How time and memory of color grow with photos and faces, and how far they are from the limit.

    python tests/color_scale.py limit PROJECT

measures what nobody can avoid on a colored project, as a process of its own: decoding all photos,
one depth render each at the size that coloring uses, and writing the files of out/ (pages encoded
as PNG again, the other bytes as they are).
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from color_runs import Run, color, make_project, timed

from texproj.color.sampling.prepare import DEPTH_SCALE
from texproj.formats.meshes import read_mesh
from texproj.formats.models.ply import write_ply
from texproj.options import RenderOptions
from texproj.project import Project
from texproj.render import open_renderer, pinhole_cover
from texproj.repair import repair


def limits(scenes: list[Path], root: Path, kinds: list[str]) -> None:
    """The whole command with all photos against the limit, processor seconds."""
    print(
        f"{'scene':14} {'to':9} {'s':>7} {'cpu s':>7} {'MB':>6}  limit, cpu s: decode render write"
    )
    for data in scenes:
        project = root / f"{data.name}-all"
        make_project(data, project, every=True)
        for kind in kinds:
            run = color(project, kind)
            print(f"{data.name:14} {kind:9} {run}  {against_limit(project, run)}", flush=True)


def against_limit(project: Path, run: Run) -> str:
    """The limit's parts and how many times as long the command took."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "limit.json"
        bare = timed([sys.executable, __file__, "limit", project, out])
        parts = json.loads(out.read_text())
    total = sum(parts.values())
    said = " ".join(f"{value:.2f}" for value in parts.values())
    return f"{total:.2f}: {said}; ratio {run.cpu / total:.1f}; {bare.megabytes:.0f} MB"


def limit(folder: Path) -> dict[str, float]:
    """Processor seconds of each part."""
    project = Project.open(folder)
    steps = {"decode": _decode, "render": _render, "write": _write}
    spent = {}
    for name, step in steps.items():
        start = time.process_time()
        step(project)
        spent[name] = time.process_time() - start
    return spent


def _decode(project: Project) -> None:
    for path in project.photo_paths.values():
        cv2.imread(str(path))


def _render(project: Project) -> None:
    """Depth of each camera; reading and uploading the mesh counts too."""
    mesh = repair(*read_mesh(project.mesh_path)).mesh
    with open_renderer(RenderOptions()) as renderer, renderer.load(mesh) as scene:
        for record in project.load_cameras().values():
            camera = record.registered_camera.scaled(DEPTH_SCALE)
            scene.gbuffer(pinhole_cover(camera), ("depth",))


def _write(project: Project) -> None:
    """Every file of out/ again."""
    with tempfile.TemporaryDirectory() as folder:
        for path in (p for p in project.out.iterdir() if p.is_file()):
            copy = Path(folder) / path.name
            if path.suffix == ".png":
                page = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
                cv2.imwrite(str(copy), page, (cv2.IMWRITE_PNG_COMPRESSION, 1))
            else:
                copy.write_bytes(path.read_bytes())


def scale(data: Path, root: Path, kinds: list[str]) -> None:
    """Ten times the photos; a million faces; four million; eight million vertices."""
    print(f"{'what':44} {'s':>7} {'cpu s':>7} {'MB':>6}")
    castle, fountain = data / "sceaux-castle", data / "fountain-P11"
    for kind in kinds:
        once = _row(castle, root, kind, "10 photos", {})
        often = _row(castle, root, kind, "100 photos", {"times": 10})
        print(f"{'':44} memory x {often.megabytes / once.megabytes:.2f}")
    for kind in kinds:
        _row(fountain, root, kind, "1 M faces", {"mesh": "mesh_1m.ply"})
    finer = root / "finer.ply"
    count = _finer(fountain / "mesh_1m.ply", finer, 1)
    for kind in (kind for kind in kinds if kind != "patches"):
        _row(fountain, root, kind, count, {"mesh": str(finer)})
    if "vertices" in kinds:
        count = _finer(fountain / "mesh_1m.ply", finer, 2)
        _row(fountain, root, "vertices", count, {"mesh": str(finer)})


def _row(data: Path, root: Path, kind: str, what: str, how: dict) -> Run:
    project = root / f"{data.name}-scale"
    make_project(data, project, every=True, **how)
    run = color(project, kind)
    print(f"{data.name + ', ' + what + ', ' + kind:44} {run}", flush=True)
    return run


def _finer(source: Path, out: Path, rounds: int) -> str:
    """Write a mesh with each face cut into four, again and again; returns its size in words."""
    mesh = repair(*read_mesh(source)).mesh
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(rounds):
        vertices, faces = _quartered(vertices, faces)
    write_ply(out, vertices, faces, None)
    return f"{len(faces) / 1e6:.1f} M faces, {len(vertices) / 1e6:.1f} M vertices"


def _quartered(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Midpoints of edges become vertices, shared by the faces on both sides."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    key = ends[:, 0] * len(vertices) + ends[:, 1]
    unique, middle = np.unique(key, return_inverse=True)
    pair = np.stack(np.divmod(unique, len(vertices)), axis=1)
    a, b, c = faces.T
    ab, bc, ca = (middle.reshape(-1, 3) + len(vertices)).T
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    finer = np.stack([np.stack(q, axis=1) for q in quarters], axis=1).reshape(-1, 3)
    return np.concatenate([vertices, vertices[pair].mean(axis=1)]), finer.astype(np.int32)


if __name__ == "__main__":
    Path(sys.argv[3]).write_text(json.dumps(limit(Path(sys.argv[2]))))
