"""All camera formats: their names, programs and files, and who read what we wrote."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from texproj.formats.interchange.arkit import read_arkit, write_arkit
from texproj.formats.interchange.blender import write_blender
from texproj.formats.interchange.blocks_exchange import (
    read_blocks_exchange,
    write_blocks_exchange,
)
from texproj.formats.interchange.bundler import read_bundler, write_bundler
from texproj.formats.interchange.colmap import read_colmap, write_colmap
from texproj.formats.interchange.meshlab import read_meshlab, write_meshlab
from texproj.formats.interchange.meshroom import read_meshroom, write_meshroom
from texproj.formats.interchange.metashape import read_metashape, write_metashape
from texproj.formats.interchange.micmac import read_micmac, write_micmac
from texproj.formats.interchange.model import ForeignModel, Shot, SizeOf, Written
from texproj.formats.interchange.nerfstudio import read_nerfstudio, write_nerfstudio
from texproj.formats.interchange.nerfstudio_poses import read_nerfstudio_poses
from texproj.formats.interchange.openmvg import read_openmvg, write_openmvg
from texproj.formats.interchange.openmvs import read_openmvs, write_openmvs
from texproj.formats.interchange.opensfm import read_opensfm, write_opensfm
from texproj.formats.interchange.opf import read_opf, write_opf
from texproj.formats.interchange.pix4d import read_pix4d, write_pix4d
from texproj.formats.interchange.realityscan import read_realityscan, write_realityscan
from texproj.formats.interchange.realityscan_xmp import (
    read_realityscan_xmp,
    write_realityscan_xmp,
)
from texproj.formats.interchange.table import read_table, write_table
from texproj.formats.interchange.texrecon import read_texrecon, write_texrecon
from texproj.formats.interchange.visualsfm import read_visualsfm, write_visualsfm

Reader = Callable[[Path, SizeOf], ForeignModel]
Writer = Callable[[Sequence[Shot], str], Written]
"""Photos, and the path of the mesh as seen from the new file."""


@dataclass(frozen=True)
class CameraFormat:
    """A format under its one name for import and export.

    programs: whose it is; files: what they are called, of what we write the first; read, write:
    None where it goes one way only; accepted: the reader of other hands that took what we write
    and found its cameras where ours are, empty where the definition alone was at hand; fisheye:
    whether it has a place for such lenses when we write it.
    """

    name: str
    programs: str
    files: str
    read: Reader | None = None
    write: Writer | None = None
    accepted: str = ""
    fisheye: bool = False


def _without_mesh(write: Callable[[Sequence[Shot]], Written]) -> Writer:
    return lambda shots, mesh: write(shots)


FORMATS = (
    CameraFormat(
        "colmap", "COLMAP", "cameras.txt, images.txt, points3D.txt", read_colmap,
        _without_mesh(write_colmap), "pycolmap", fisheye=True,
    ),
    CameraFormat(
        "colmap-binary", "COLMAP", "cameras.bin, images.bin, points3D.bin", read_colmap,
        lambda shots, mesh: write_colmap(shots, binary=True), "pycolmap", fisheye=True,
    ),
    CameraFormat(
        "bundler", "Bundler, VisualSFM, others", "bundle.out, list.txt", read_bundler,
        _without_mesh(write_bundler),
    ),
    CameraFormat("meshlab", "MeshLab", "cameras.mlp", read_meshlab, write_meshlab, "PyMeshLab"),
    CameraFormat(
        "metashape", "Agisoft Metashape, PhotoScan", "cameras.xml", read_metashape,
        _without_mesh(write_metashape), fisheye=True,
    ),
    CameraFormat(
        "realityscan", "RealityScan, RealityCapture", "cameras.csv", read_realityscan,
        _without_mesh(write_realityscan),
    ),
    CameraFormat(
        "realityscan-xmp", "RealityScan, RealityCapture", "STEM.xmp", read_realityscan_xmp,
        _without_mesh(write_realityscan_xmp),
    ),
    CameraFormat(
        "nerfstudio", "nerfstudio, instant-ngp", "transforms.json", read_nerfstudio,
        _without_mesh(write_nerfstudio), fisheye=True,
    ),
    CameraFormat(
        "nerfstudio-poses", "nerfstudio (ns-export cameras)", "transforms_train.json",
        lambda path, size_of: read_nerfstudio_poses(path, size_of, read_nerfstudio),
    ),
    CameraFormat(
        "openmvg", "openMVG", "sfm_data.json", read_openmvg, _without_mesh(write_openmvg)
    ),
    CameraFormat(
        "meshroom", "Meshroom, AliceVision", "cameras.sfm", read_meshroom,
        _without_mesh(write_meshroom),
    ),
    CameraFormat(
        "opensfm", "OpenSfM, OpenDroneMap", "reconstruction.json", read_opensfm,
        _without_mesh(write_opensfm), fisheye=True,
    ),
    CameraFormat(
        "blocks-exchange", "iTwin Capture, ContextCapture, DJI Terra", "blocks.xml",
        read_blocks_exchange, _without_mesh(write_blocks_exchange), fisheye=True,
    ),
    CameraFormat(
        "pix4d", "Pix4Dmapper", "..._calibrated_camera_parameters.txt", read_pix4d,
        _without_mesh(write_pix4d),
    ),
    CameraFormat(
        "opf", "Pix4D (Open Photogrammetry Format)", "cameras.opf and its .json", read_opf,
        _without_mesh(write_opf), "pyopf", fisheye=True,
    ),
    CameraFormat(
        "visualsfm", "VisualSFM", "cameras.nvm", read_visualsfm, _without_mesh(write_visualsfm)
    ),
    CameraFormat(
        "texrecon", "texrecon, MVE", "STEM.cam", read_texrecon, _without_mesh(write_texrecon)
    ),
    CameraFormat(
        "openmvs", "OpenMVS", "cameras.mvs", read_openmvs, _without_mesh(write_openmvs)
    ),
    CameraFormat(
        "arkit", "Polycam, 3D Scanner App", "STEM.json", read_arkit, _without_mesh(write_arkit)
    ),
    CameraFormat(
        "table", "surveyors, drones, Metashape, Pix4D", "orientations.txt", read_table,
        _without_mesh(write_table),
    ),
    CameraFormat(
        "micmac", "MicMac (Apero, Tapas)", "Orientation-PHOTO.xml and calibrations", read_micmac,
        _without_mesh(write_micmac), fisheye=True,
    ),
    CameraFormat("blender", "Blender", "cameras.py", None, write_blender, "Blender 5.0"),
)  # fmt: skip

READERS = {form.name: form.read for form in FORMATS if form.read is not None}
"""Readers by the name of their format."""

WRITERS = {form.name: form.write for form in FORMATS if form.write is not None}
"""Writers by the name of their format."""

FISHEYE_WRITERS = tuple(form.name for form in FORMATS if form.fisheye)
"""Formats that we write fisheyes to."""
