"""A surface as it is lit: its shape, and what it reflects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from texproj.arrays import Floats
from texproj.mesh import ColoredMesh, Mesh, TexturedMesh, vertex_normals
from texproj.render.model import Met, Paint, bumps_of, paint_of
from texproj.tangent_frames import colors_as_directions

CORNERS = np.eye(3, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class LitSurface:
    """model: the base color, in vertices or textures, and normals of its own if it has any;
    roughness, metallic: (V,) float32 in 0..1 of its vertices.
    """

    model: TexturedMesh | ColoredMesh
    roughness: Floats
    metallic: Floats

    @cached_property
    def mesh(self) -> Mesh:
        return Mesh(self.model.vertices, self.model.faces)

    @cached_property
    def normals(self) -> Floats:
        """(V, 3) unit normals: the model's own, which do not end where its texture is cut."""
        own = self.model.normals
        return (vertex_normals(self.mesh) if own is None else own).astype(np.float32)

    @cached_property
    def _bumps(self) -> tuple[Paint, Floats] | None:
        paint = bumps_of(self.model)
        if paint is None or not isinstance(self.model, TexturedMesh):
            return None
        assert self.model.normal_map is not None
        frames = self.model.normal_map.tangents.astype(np.float32)
        return paint, frames[self.model.uv_faces]

    def bent(self, met: Met, normal: Floats) -> Floats:
        """(n, 3) unit normals (n, 3) between those of the corners, as the normal map bends them."""
        if self._bumps is None:
            return normal
        paint, frames = self._bumps
        tangent: Floats = np.einsum("nk,nkc->nc", met.weights, frames[met.face])
        return colors_as_directions(paint(met), normal, tangent)

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
