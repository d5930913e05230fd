"""The result's colors on the vertices of the mesh that the page shows."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.preview.surface import Surface
from texproj.project import Project


def vertex_colors(project: Project, surface: Surface) -> NDArray[np.uint8]:
    """(V, 4) uint8 sRGB and 255 (0 = no photo sees it) of each vertex of the repaired mesh.

    Raises InputError if there is no out/model.ply, or it belongs to another mesh.
    """
    path = project.out / "model.ply"
    if not path.is_file():
        raise InputError(f"no {path}; color the vertices first")
    loaded = trimesh.load(path, process=False)
    rgba = np.asarray(loaded.visual.vertex_colors, np.uint8)
    source = surface.source
    if len(rgba) != len(source.source_vertices):
        raise InputError(f"{path} was made from another mesh; color it again")
    out = np.zeros((len(source.mesh.vertices), 4), np.uint8)
    known = source.vertex_of_source >= 0
    out[source.vertex_of_source[known]] = rgba[known]
    return out
