"""Mesh simplification in a process of its own: `python -m texproj.simplify FOLDER FACES`.

PyMeshLab is not safe to use from two threads and keeps Python from doing anything else meanwhile;
the page's server goes on answering while this works.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from texproj.errors import TexprojError
from texproj.mesh import Mesh

TIMEOUT_S = 600


def decimated(mesh: Mesh, faces: int) -> Mesh:
    """About `faces` faces of the same shape by quadric edge collapse (Garland and Heckbert 1997).

    Raises TexprojError where PyMeshLab cannot be used.
    """
    with tempfile.TemporaryDirectory() as folder:
        np.save(Path(folder) / "vertices.npy", mesh.vertices - mesh.center)
        np.save(Path(folder) / "faces.npy", mesh.faces)
        command = [sys.executable, "-m", "texproj.simplify", folder, str(faces)]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
        )
        if done.returncode:
            reason = (done.stderr.strip() or "no reason given").splitlines()[-1]
            raise TexprojError(f"the mesh cannot be simplified: {reason}")
        vertices, triangles = (np.load(Path(folder) / f"{n}.npy") for n in ("vertices", "faces"))
    return Mesh(vertices + mesh.center, triangles)


def simplify_files(folder: Path, faces: int) -> None:
    """Replace vertices.npy and faces.npy in `folder` by those of the simplified mesh."""
    import pymeshlab  # noqa: PLC0415 - needs system libraries that the rest does not

    meshes = pymeshlab.MeshSet()
    vertices, triangles = np.load(folder / "vertices.npy"), np.load(folder / "faces.npy")
    meshes.add_mesh(pymeshlab.Mesh(vertices, triangles))
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=faces, preservenormal=True, preserveboundary=True
    )
    result = meshes.current_mesh()
    np.save(folder / "vertices.npy", result.vertex_matrix())
    np.save(folder / "faces.npy", result.face_matrix().astype(np.int32))


if __name__ == "__main__":
    simplify_files(Path(sys.argv[1]), int(sys.argv[2]))
