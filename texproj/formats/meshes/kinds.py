"""The kinds of mesh files that are read: what is taken, and who wrote those of the tests."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MeshKind:
    """brings: what is taken from such a file; tried: programs whose files the tests read, empty
    where these follow the definition alone.
    """

    name: str
    suffixes: tuple[str, ...]
    brings: str
    tried: str = ""


MESH_KINDS = (
    MeshKind(
        "PLY", (".ply",), "polygons, strips; texture coordinates, images",
        "MeshLab, plyfile, trimesh",
    ),
    MeshKind(
        "OBJ", (".obj",), "polygons; texture coordinates, materials, tiles, objects", "trimesh"
    ),
    MeshKind("STL", (".stl",), "triangles, text or binary", "trimesh"),
    MeshKind("OFF", (".off",), "polygons", "trimesh"),
    MeshKind(
        "glTF", (".glb", ".gltf"),
        "nodes, materials, texture coordinates", "trimesh, gltfpack, glTF-Transform",
    ),
)  # fmt: skip

MESH_SUFFIXES = tuple(suffix for kind in MESH_KINDS for suffix in kind.suffixes)
