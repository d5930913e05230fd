"""Cameras of other programs: one module per format, all of them in our conventions."""

from collections.abc import Callable, Sequence
from pathlib import Path

from texproj.formats.interchange.bundler import read_bundler, write_bundler
from texproj.formats.interchange.colmap import read_colmap, write_colmap
from texproj.formats.interchange.detect import detect, other_models
from texproj.formats.interchange.meshlab import read_meshlab, write_meshlab
from texproj.formats.interchange.meshroom import read_meshroom
from texproj.formats.interchange.metashape import read_metashape, write_metashape
from texproj.formats.interchange.model import (
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Written,
)
from texproj.formats.interchange.nerfstudio import read_nerfstudio, write_nerfstudio
from texproj.formats.interchange.openmvg import read_openmvg
from texproj.formats.interchange.realityscan import read_realityscan, write_realityscan
from texproj.formats.interchange.realityscan_xmp import read_realityscan_xmp
from texproj.formats.interchange.upright import QUARTER_TURNS, upright

READERS: dict[str, Callable[[Path, SizeOf], ForeignModel]] = {
    "colmap": read_colmap,
    "bundler": read_bundler,
    "meshlab": read_meshlab,
    "metashape": read_metashape,
    "realityscan": read_realityscan,
    "realityscan-xmp": read_realityscan_xmp,
    "nerfstudio": read_nerfstudio,
    "openmvg": read_openmvg,
    "meshroom": read_meshroom,
}
"""Readers by the name of their format."""

WRITERS: dict[str, Callable[[Sequence[Shot], str], Written]] = {
    "colmap": lambda shots, mesh: write_colmap(shots),
    "colmap-binary": lambda shots, mesh: write_colmap(shots, binary=True),
    "bundler": lambda shots, mesh: write_bundler(shots),
    "meshlab": write_meshlab,
    "metashape": lambda shots, mesh: write_metashape(shots),
    "realityscan": lambda shots, mesh: write_realityscan(shots),
    "nerfstudio": lambda shots, mesh: write_nerfstudio(shots),
}
"""Writers by the name of their format: photos, and the path of the mesh as seen from the file."""

__all__ = [
    "QUARTER_TURNS",
    "READERS",
    "WRITERS",
    "ForeignCamera",
    "ForeignModel",
    "Shot",
    "SizeOf",
    "Written",
    "detect",
    "other_models",
    "upright",
]
