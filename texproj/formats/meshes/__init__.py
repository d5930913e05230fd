"""Reading meshes: geometry only, in the file's own frame, units, precision and order."""

from texproj.formats.meshes.read import MESH_SUFFIXES, MeshFile, read_mesh, read_mesh_file

__all__ = ["MESH_SUFFIXES", "MeshFile", "read_mesh", "read_mesh_file"]
