"""Reading meshes in the file's own frame, units, precision and order, with their textures."""

from texproj.formats.meshes.companions import companions
from texproj.formats.meshes.kinds import MESH_KINDS, MESH_SUFFIXES
from texproj.formats.meshes.pictures import picture_side, read_picture
from texproj.formats.meshes.read import MeshFile, read_mesh, read_mesh_file

__all__ = [
    "MESH_KINDS",
    "MESH_SUFFIXES",
    "MeshFile",
    "companions",
    "picture_side",
    "read_mesh",
    "read_mesh_file",
    "read_picture",
]
