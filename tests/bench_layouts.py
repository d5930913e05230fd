"""Kept texture coordinates and fewer faces against the whole, by photos that were left out.

    python tests/bench_layouts.py --script REPHOTO.py [--what kept,levels] [--data DIR] [--keep DIR]

kept: the fountain is colored with a layout of our own, made into a glb of two nodes and a recolored
texture as an artist leaves it, and colored again with the same photos: coordinates bit for bit,
names, and fidelity to the photos left out beside that of our own layout. levels: the scan of a
million faces as it is, and with the faces that are asked for. The script measures as for
tests/bench_color.py.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

import cv2
import numpy as np
from color_runs import CHECKOUT, color, compared, make_project
from layout_files import Read, glb
from scipy.spatial.transform import Rotation

from texproj.formats.models import read_model
from texproj.mesh import TexturedMesh

SCENE = "fountain-P11"
FACES = 100_000
TURN = Rotation.from_euler("y", 0.6).as_matrix()
PLAIN = "[color]\noccluders = false\n"
NODES = ("left basin", "right basin")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    default = os.environ.get("TEXPROJ_DATA") or CHECKOUT / "../shared/data"
    parser.add_argument("--what", default="kept,levels")
    parser.add_argument("--data", type=Path, default=Path(default))
    parser.add_argument("--script", type=Path, required=True, help="the measuring script")
    parser.add_argument("--keep", type=Path, help="folder in which the projects stay")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        root, data = given.keep or Path(temporary), given.data / SCENE
        if "kept" in given.what:
            kept(data, root, given.script)
        if "levels" in given.what:
            levels(data, root, given.script)


def kept(data: Path, root: Path, script: Path) -> None:
    own, artist = root / "own", root / "kept"
    for project in (own, artist):
        make_project(data, project)
        (project / "project.toml").write_text(PLAIN)
    color(own, "texture")
    for mesh in (artist / "mesh").iterdir():
        mesh.unlink()
    file = artist / "mesh/artist.glb"
    file.write_bytes(artists(read_model(own / "out/model.glb")))
    run = color(artist, "texture")
    print(f"kept: {run.seconds:.1f} s, {run.megabytes:.0f} MB")
    before, after = Read(file), Read(artist / "out/model.glb")
    for node in NODES:
        was, now = before.corners(node), after.corners(node)
        same = all(np.array_equal(was[name][1], now[name][1]) for name in was)
        print(f"{node}: materials {sorted(now)}, coordinates the same: {same}")
    for name, project in (("own layout", own), ("kept", artist)):
        print(f"{name:12} {told(compared(data, project / 'out/model.glb', script))}")


def artists(model: TexturedMesh) -> bytes:
    """The model as two nodes with places of their own; its texture in other colors."""
    side = model.vertices[model.faces].mean(axis=1)[:, 0]
    right = side > np.median(side)
    uv = model.uv * (1, -1) + (0, 1)
    parts = []
    for chosen, turn in ((~right, np.eye(3)), (right, TURN)):
        primitives = []
        for page in np.unique(model.page_of_face[chosen]).tolist():
            rows = chosen & (model.page_of_face == page)
            pairs = np.stack([model.faces[rows].ravel(), model.uv_faces[rows].ravel()], axis=1)
            used, index = np.unique(pairs, axis=0, return_inverse=True)
            xyz = model.vertices[used[:, 0]] @ turn
            primitives.append((xyz, uv[used[:, 1]], index.reshape(-1, 3), page))
        parts.append(primitives)
    turned = Rotation.from_matrix(TURN).as_quat().tolist()
    nodes = [
        {"name": "fountain", "children": [1, 2]},
        {"name": NODES[0], "mesh": 0},
        {"name": NODES[1], "mesh": 1, "rotation": turned},
    ]
    images = [cv2.imencode(".png", page)[1].tobytes() for page in model.pages]  # red is blue
    materials = [(f"stone {i}", i) for i in range(len(images))]
    return glb(nodes, list(zip(NODES, parts, strict=True)), materials, images)


def levels(data: Path, root: Path, script: Path) -> None:
    project = root / "levels"
    make_project(data, project, mesh="mesh_1m.ply")
    asked = f'[output]\nmodels = ["glb"]\nfaces = [10000000, {FACES}]\n'
    (project / "project.toml").write_text(PLAIN + asked)
    run = color(project, "texture")
    print(f"levels: {run.seconds:.1f} s, {run.cpu:.1f} s of processors, {run.megabytes:.0f} MB")
    for name, file in (("whole", "model.glb"), (f"{FACES} faces", "model_lod1.glb")):
        size = (project / "out" / file).stat().st_size / 1e6
        print(f"{name:12} {size:6.1f} MB {told(compared(data, project / 'out' / file, script))}")


def told(measured: dict[str, float]) -> str:
    names = {"psnr": "PSNR", "ssim": "SSIM", "one_minus_ncc": "1-NCC", "detail": "detail"}
    return ", ".join(f"{label} {measured[name]:.3f}" for name, label in names.items())


if __name__ == "__main__":
    main()
