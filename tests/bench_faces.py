"""Large meshes: how long `texproj color` takes, and how much memory.

    python tests/bench_faces.py SCENE_FOLDER [--millions 5.5,20] [--to vertices,texture]

The scene's mesh_1m.ply is subdivided to so many million faces and colored from all photos at their
reference cameras; what stands in front of it is not sought. Floors: 20 million faces for vertices
within 4 GB, 5.5 million with a texture within 90 s of processor time and 1.5 GB.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from color_runs import color, make_project

from texproj.formats.meshes import read_mesh
from texproj.formats.models.ply import write_ply


def subdivided(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each face as four, its edges halved."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    key = edges[:, 0].astype(np.int64) * len(vertices) + edges[:, 1]
    own, number = np.unique(key, return_inverse=True)
    middles = (vertices[own // len(vertices)] + vertices[own % len(vertices)]) / 2
    a, b, c = (len(vertices) + number.reshape(3, -1)).astype(np.int32)
    x, y, z = faces.T
    four = [(x, a, c), (a, y, b), (c, b, z), (a, b, c)]
    parts = [np.stack(corners, axis=1) for corners in four]
    return np.concatenate([vertices, middles]), np.concatenate(parts)


def with_faces(vertices: np.ndarray, faces: np.ndarray, count: int):
    """So many faces: all in four as often as that fits, then some in three."""
    while 4 * len(faces) <= count:
        vertices, faces = subdivided(vertices, faces)
    split, kept = np.split(faces, [max((count - len(faces)) // 2, 0)])
    middle = len(vertices) + np.arange(len(split), dtype=np.int32)
    x, y, z = split.T
    thirds = [np.stack([p, q, middle], axis=1) for p, q in ((x, y), (y, z), (z, x))]
    vertices = np.concatenate([vertices, vertices[split].mean(axis=1).reshape(-1, 3)])
    return vertices, np.concatenate([kept, *thirds]).astype(np.int32)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path)
    parser.add_argument("--millions", default="5.5,20")
    parser.add_argument("--to", default="vertices")
    options = parser.parse_args()
    given = [np.asarray(part) for part in read_mesh(options.scene / "mesh_1m.ply")]
    print(f"{'faces':>9} {'to':9} {'s':>7} {'cpu s':>7} {'MB':>6}")
    for millions in map(float, options.millions.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder) / "large"
            make_project(options.scene, root, every=True)
            vertices, faces = with_faces(*given, int(1e6 * millions))
            next((root / "mesh").iterdir()).unlink()
            write_ply(root / "mesh" / "scan.ply", vertices, faces, None)
            (root / "project.toml").write_text("[color]\noccluders = false\n")
            for kind in options.to.split(","):
                print(f"{len(faces):9d} {kind:9} {color(root, kind)}", flush=True)


if __name__ == "__main__":
    main()
