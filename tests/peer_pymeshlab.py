"""MeshLab's masked blending of vertex colors, for comparison (Callieri et al. 2008 as simplified in
its filter): photos as rasters of a MeshLab project.

    python tests/peer_pymeshlab.py PROJECT OUT.ply

PROJECT/out/cameras-meshlab/cameras.mlp is made by `texproj export PROJECT --format meshlab`. The
filter takes the principal point as centered; its depth tolerance is in mesh units.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pymeshlab


def main() -> None:
    project, out = Path(sys.argv[1]), Path(sys.argv[2])
    meshes = pymeshlab.MeshSet()
    meshes.load_project(str(project / "out/cameras-meshlab/cameras.mlp"))
    box = meshes.current_mesh().bounding_box()
    tolerance = 0.002 * float(np.linalg.norm(box.max() - box.min()))
    meshes.compute_color_from_active_rasters_projection(deptheta=tolerance)
    meshes.save_current_mesh(str(out))


if __name__ == "__main__":
    main()
