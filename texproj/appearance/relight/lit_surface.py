"""A surface as it is lit: its shape, and what it reflects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from texproj.arrays import Floats
from texproj.mesh import ColoredMesh, Mesh, TexturedMesh
from texproj.render.model import Met, Paint, paint_of

CORNERS = np.eye(3, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class LitSurface:
    """model: the base color, in vertices or textures; roughness, metallic: (V,) float32 in 0..1 of
    its vertices.
    """

    model: TexturedMesh | ColoredMesh
    roughness: Floats
    metallic: Floats

    @cached_property
    def mesh(self) -> Mesh:
        return Mesh(self.model.vertices, self.model.faces)

    @cached_property
    def paint(self) -> Paint:
        """Linear base colors where rays meet the model."""
        return paint_of(self.model)

    @cached_property
    def base_of_vertex(self) -> Floats:
        """(V, 3) linear base color at the vertices, for light that goes from one to another."""
        faces = self.model.faces
        out = np.zeros((len(self.model.vertices), 3), np.float32)
        number = np.arange(len(faces), dtype=np.int32)
        for corner in range(3):
            there = np.broadcast_to(CORNERS[corner], (len(faces), 3))
            area = np.ones(len(faces), np.float32)
            out[faces[:, corner]] = self.paint(Met(number, there, area, area > 0))
        return out
