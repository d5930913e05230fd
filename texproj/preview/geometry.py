"""The mesh as bytes that a graphics card takes as they are, and a light stand-in for it.

A pack is: 4 bytes little-endian length of a JSON header; the header, padded with spaces to a
multiple of 4; then the arrays one after the other, each padded to a multiple of 4. The header
tells name, dtype, shape and byte offset (from the end of the header) of each array.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.mesh import Mesh, vertex_normals
from texproj.register.block.light_mesh import light_mesh
from texproj.simplify import decimated

ALIGNMENT = 4
LARGE_FACES = 2_000_000
"""A mesh of more is shown light at first: of 5.5 million faces a browser is sent 10 MB in place of
110, and draws them while it turns."""


@dataclass(frozen=True, eq=False)
class LightMesh:
    """A mesh of few faces for use while the view moves.

    mesh: the simplified surface; vertex_of_light: (L,) int32, for each of its vertices the
    nearest vertex of the full mesh, where its color is taken.
    """

    mesh: Mesh
    vertex_of_light: NDArray[np.int32]


def pack(arrays: dict[str, NDArray[Any]], **facts: Any) -> bytes:
    """Arrays and some facts about them as one block of bytes (layout: see the module)."""
    entries, blocks, offset = {}, [], 0
    for name, array in arrays.items():
        data = np.ascontiguousarray(array).tobytes()
        entries[name] = {"dtype": array.dtype.str[1:], "shape": array.shape, "offset": offset}
        data += b"\0" * (-len(data) % ALIGNMENT)
        blocks.append(data)
        offset += len(data)
    header = json.dumps({**facts, "arrays": entries}).encode()
    header += b" " * (-len(header) % ALIGNMENT)
    return b"".join([len(header).to_bytes(4, "little"), header, *blocks])


def pack_mesh(
    mesh: Mesh, center: NDArray[np.float64], of_faces: int, **more: NDArray[Any]
) -> bytes:
    """Positions relative to `center` (float32), normals (int8, unit = 127) and faces (uint32).
    of_faces: how many the whole mesh has.
    """
    positions = (mesh.vertices - center).astype(np.float32)
    normals = np.zeros((len(positions), 4), np.int8)
    normals[:, :3] = np.round(vertex_normals(mesh) * 127)
    faces = mesh.faces.astype(np.uint32)
    more |= {"positions": positions, "normals": normals, "faces": faces}
    return pack(more, center=list(center), of_faces=of_faces)


def simplified(mesh: Mesh, faces: int) -> LightMesh | None:
    """About `faces` faces of the same shape by quadric edge collapse; of a large mesh more, that
    are made in seconds: the page shows them at first. None if it has fewer.

    Raises TexprojError where PyMeshLab cannot be loaded.
    """
    if len(mesh.faces) <= faces:
        return None
    from scipy.spatial import cKDTree  # noqa: PLC0415 - slow to import, needed once

    light = light_mesh(mesh)
    if not is_large(mesh):
        light = decimated(light, faces)
    tree = cKDTree(mesh.vertices, balanced_tree=False, compact_nodes=False)  # in a third of a time
    nearest = tree.query(light.vertices, workers=-1)[1]
    return LightMesh(light, np.asarray(nearest, np.int32))


def is_large(mesh: Mesh) -> bool:
    """Whether the page shows the light mesh until somebody asks for all of it."""
    return len(mesh.faces) > LARGE_FACES
