"""Writing colored models: ply and glb with vertex colors, obj, glb and usdz with textures."""

from texproj.formats.models.basis import require_basisu, write_ktx2
from texproj.formats.models.glb import GlbImage, write_colored_glb, write_glb
from texproj.formats.models.images import (
    ImageFormat,
    encode_image,
    numbered,
    page_files,
    to_8_bit,
    write_pages,
)
from texproj.formats.models.kinds import MODEL_KINDS
from texproj.formats.models.lit import Gloss, Images, Parts, write_glossy_glb, write_lit_glb
from texproj.formats.models.obj import write_obj
from texproj.formats.models.page_names import file_endings
from texproj.formats.models.ply import write_ply
from texproj.formats.models.read import read_model, scan_from_node
from texproj.formats.models.usdz import write_usdz

__all__ = [
    "MODEL_KINDS",
    "GlbImage",
    "Gloss",
    "ImageFormat",
    "Images",
    "Parts",
    "encode_image",
    "file_endings",
    "numbered",
    "page_files",
    "read_model",
    "require_basisu",
    "scan_from_node",
    "to_8_bit",
    "write_colored_glb",
    "write_glb",
    "write_glossy_glb",
    "write_ktx2",
    "write_lit_glb",
    "write_obj",
    "write_pages",
    "write_ply",
    "write_usdz",
]
