"""Writing colored models: ply with vertex colors, obj and glb with textures, and their images."""

from texproj.formats.models.glb import write_glb
from texproj.formats.models.images import encode_image, encode_pages
from texproj.formats.models.obj import write_obj
from texproj.formats.models.ply import write_ply
from texproj.formats.models.read import read_model

__all__ = ["encode_image", "encode_pages", "read_model", "write_glb", "write_obj", "write_ply"]
