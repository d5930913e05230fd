"""Reading meshes in the file's own frame, units, precision and order, with their textures."""

from typing import TYPE_CHECKING

from texproj.formats.meshes.kinds import MESH_KINDS, MESH_SUFFIXES
from texproj.loading import when_used

if TYPE_CHECKING:
    from texproj.formats.meshes.pictures import picture_side, read_picture
    from texproj.formats.meshes.read import MeshFile, read_mesh, read_mesh_file

_HOMES = {
    "MeshFile": "texproj.formats.meshes.read",
    "picture_side": "texproj.formats.meshes.pictures",
    "read_mesh": "texproj.formats.meshes.read",
    "read_mesh_file": "texproj.formats.meshes.read",
    "read_picture": "texproj.formats.meshes.pictures",
}

__all__ = [
    "MESH_KINDS",
    "MESH_SUFFIXES",
    "MeshFile",
    "picture_side",
    "read_mesh",
    "read_mesh_file",
    "read_picture",
]

if not TYPE_CHECKING:  # most of what asks for names of files reads no mesh
    __getattr__ = when_used(__name__, _HOMES)
