"""Carved pieces of stone, made by rule: a shrine, a stele with a niche, and a capital
with leaves.

Local frame: metres, z up, the piece stands on z = 0 around the z axis, front towards -y.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.demo import capital, shrine, stele
from texproj.demo.noise import noise
from texproj.demo.shapes import Field
from texproj.demo.surface import surface
from texproj.mesh import Mesh, vertex_normals

Kind = Literal["shrine", "stele", "capital"]

_SOLIDS: dict[Kind, Callable[[int], tuple[Field, tuple[float, float, float]]]] = {
    "shrine": shrine.solid,
    "stele": stele.solid,
    "capital": capital.solid,
}


@dataclass(frozen=True, eq=False)
class Piece:
    """A solid: its distance field in the local frame and a box around it, (2, 3) metres."""

    field: Field
    bounds: NDArray[np.float64]


def piece(kind: Kind = "stele", seed: int = 0) -> Piece:
    """One carved piece; the seed changes proportions, ornaments, damage and wear."""
    solid, size = _SOLIDS[kind](seed)
    x, y, z = size

    def worn(xyz: Floats) -> Floats:
        return solid(xyz) + 0.0022 * noise(xyz, 0.7, seed + 11, 2.2)

    return Piece(worn, np.array([[-x, -y, -0.03], [x, y, z]]))


def carved(made: Piece, faces: int) -> Mesh:
    """The piece's surface with about `faces` triangles, local frame."""
    return surface(made.field, made.bounds, faces)


def scanned(made: Piece, faces: int, sigma: float, seed: int = 0) -> Mesh:
    """The piece as a scanner would give it: sampled elsewhere, with noise along the normals.

    sigma: standard deviation in metres; two thirds of its variance is shared by neighbors, as
    where scans overlap, the rest is independent per vertex.
    """
    rng = np.random.default_rng([seed, 31])
    shift = rng.uniform(0, 0.02, 3)
    mesh = surface(made.field, made.bounds - [[0.02] * 3, [-0.02] * 3] + shift, faces)
    broad = noise(mesh.vertices.astype(np.float32), 0.5, seed + 5, 1.5)
    height = sigma * (np.sqrt(2 / 3) * broad + np.sqrt(1 / 3) * rng.standard_normal(len(broad)))
    return Mesh(mesh.vertices + vertex_normals(mesh) * height[:, None], mesh.faces)
