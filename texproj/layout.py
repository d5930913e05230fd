"""What a mesh file brings beside its surface: texture coordinates, materials, nodes and names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

NO_PLACE = -1
"""In place of a row: a corner without texture coordinates, a face without a material."""


@dataclass(frozen=True, eq=False)
class SurfaceMap:
    """An image of something else than colors, at the same texture coordinates.

    role: glTF's word for it (normalTexture, say); image: its file or its bytes; mime: its kind;
    strength: glTF's scale or strength, 1 where nothing is said.
    """

    role: str
    image: Path | bytes
    mime: str
    strength: float = 1.0


@dataclass(frozen=True, eq=False)
class Surface:
    """What a material says beside its colors. roughness, metallic: glTF's factors, None where the
    file does not say.
    """

    maps: tuple[SurfaceMap, ...] = ()
    roughness: float | None = None
    metallic: float | None = None


@dataclass(frozen=True, eq=False)
class Material:
    """A surface as the file names it.

    image: the file of its colors, or its bytes; None = it has none. color: (3,) factor on them,
    linear light. why: what is wrong with the image, empty if nothing is known to be. least_px: what
    the sides of its pages have at least.
    """

    name: str
    image: Path | bytes | None = None
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    why: str = ""
    least_px: int = 0
    surface: Surface = field(default_factory=Surface)


@dataclass(frozen=True, eq=False)
class Node:
    """A part of a scene.

    mesh_name: of the mesh that it shows, if the file names it apart; children: rows of the nodes;
    placing: its transform as glTF writes it (matrix, or rotation, translation, scale);
    world: (4, 4) float64 from its own frame to the frame of the file.
    """

    name: str
    mesh_name: str = ""
    children: tuple[int, ...] = ()
    placing: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    world: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the faces of a mesh lie in textures, as its file has it.

    uv: (T, 2) float64 as the file has them, u right, v up from the bottom, or down from the top
    where `v_down` (glTF); whole numbers lead to other tiles (UDIM).
    faces: (F, 3) int32 into uv, corner by corner as the mesh's faces; `NO_PLACE` where there are
    no coordinates.
    material_of_face, node_of_face: (F,) int32.
    """

    uv: NDArray[np.float64]
    faces: NDArray[np.int32]
    material_of_face: NDArray[np.int32]
    node_of_face: NDArray[np.int32]
    materials: tuple[Material, ...]
    nodes: tuple[Node, ...]
    v_down: bool = False

    @property
    def uv_down(self) -> NDArray[np.float64]:
        """(T, 2) with v down from the top."""
        return self.uv if self.v_down else self.uv * (1, -1) + (0, 1)

    @property
    def uv_up(self) -> NDArray[np.float64]:
        """(T, 2) with v up from the bottom."""
        return self.uv * (1, -1) + (0, 1) if self.v_down else self.uv

    @property
    def placed(self) -> NDArray[np.bool_]:
        """(F,) whether all corners of a face have coordinates."""
        return np.asarray((self.faces >= 0).all(axis=1))

    def of_faces(self, rows: NDArray[np.intp]) -> Layout:
        """That of some of the faces."""
        return Layout(
            self.uv, self.faces[rows], self.material_of_face[rows], self.node_of_face[rows],
            self.materials, self.nodes, self.v_down,
        )  # fmt: skip
