"""MeshLab projects (.mlp): the VCGCamera of each MLRaster.

A point seen from the camera is ``q = RotationMatrix (X - C)`` with ``C = -TranslationVector``, y
up, -z forward. With depth ``-q.z``, ``x = FocalMm q.x / depth / PixelSizeMm.x + CenterPx.x``, and y
likewise but measured up from the bottom of the image (vcglib wrap/qt/shot_qt.h, math/shot.h,
math/camera.h).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import read_xml
from texproj.formats.interchange.model import (
    Y_AND_Z_FLIPPED,
    Array,
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    brown_terms,
    left_out,
    lens,
    numbers,
    pose_at,
    possible,
    rotation,
    sentences,
    words,
)

MOST_SCALE = 1e12
"""By how much a layer may be enlarged; numbers far beyond are no scale."""
FOCAL_MM = 36.0
"""Nominal focal length of what we write; only its ratio to the pixel size means something."""


def read_meshlab(path: Path, size_of: SizeOf) -> ForeignModel:
    """The rasters of a MeshLab project.

    The matrix of a single mesh layer is undone, so that cameras are in the frame of the mesh
    file. Raises InputError for broken files and for cameras in binary.
    """
    root = read_xml(path)
    if root.tag != "MeshLabProject":
        raise InputError(
            f"{path}: not a MeshLab project (<{excerpt(root.tag)}> instead of <MeshLabProject>)"
        )
    found, refused = [], {}
    layer, notes = _layer_matrix(root, path)
    for raster in root.iter("MLRaster"):
        name = _name(raster)
        try:
            found.append(_raster(raster, layer, name, f"{path}, {excerpt(name)}"))
        except Unusable as reason:
            refused[name] = str(reason)
    return ForeignModel(tuple(found), refused, notes=notes)


def write_meshlab(shots: Sequence[Shot], mesh: str) -> Written:
    """A project of the mesh (its path as seen from the new file) and one raster per photo."""
    root = ET.Element("MeshLabProject")
    layer = ET.SubElement(ET.SubElement(root, "MeshGroup"), "MLMesh", label="mesh", filename=mesh)
    ET.SubElement(layer, "MLMatrix44").text = "\n1 0 0 0 \n0 1 0 0 \n0 0 1 0 \n0 0 0 1 \n"
    group = ET.SubElement(root, "RasterGroup")
    for shot in shots:
        raster = ET.SubElement(group, "MLRaster", label=shot.name)
        ET.SubElement(raster, "VCGCamera", _attributes(shot.camera))
        ET.SubElement(raster, "Plane", semantic="1", fileName=shot.path)
    ET.indent(root)
    text = "<!DOCTYPE MeshLabDocument>\n" + ET.tostring(root, encoding="unicode") + "\n"
    return Written.of({"cameras.mlp": text.encode()}, shots, _lost)


def _name(raster: ET.Element) -> str:
    plane = raster.find("Plane")
    name = (plane.get("fileName") if plane is not None else None) or raster.get("label")
    return name or "raster without a name"


def _layer_matrix(root: ET.Element, path: Path) -> tuple[Array, tuple[str, ...]]:
    """World of the project from the mesh file's frame."""
    texts = [layer.findtext("MLMatrix44") or "" for layer in root.iter("MLMesh")]
    if len(texts) != 1 or not texts[0].strip():
        return np.eye(4), ()
    matrix = numbers(texts[0], 16, f"{path}, MLMatrix44").reshape(4, 4)
    if np.array_equal(matrix, np.eye(4)):
        return matrix, ()
    checked_translation(matrix[:3, 3], f"{path}, MLMatrix44")
    size = np.abs(matrix[:3, :3]).max()
    if not MOST_SCALE > size > 1 / MOST_SCALE or not np.linalg.det(matrix[:3, :3] / size) > 1e-9:
        raise InputError(f"{path}, MLMatrix44: not a rotation, a scale and a translation")
    return matrix, (
        "the mesh layer has a matrix of its own; cameras are put into the file's frame",
    )


def _raster(raster: ET.Element, layer: Array, name: str, where: str) -> ForeignCamera:
    vcg = raster.find("VCGCamera")
    if vcg is None:
        raise Unusable("it has no camera there")
    if vcg.get("BinaryData", "0") != "0":
        raise InputError(f"{where}: the camera is in binary; save the project without that option")
    if vcg.get("CameraType", "0") != "0":
        raise Unusable("its camera is not a perspective one")
    R = numbers(vcg.get("RotationMatrix"), 16, f"{where}, RotationMatrix").reshape(4, 4)[:3, :3]
    center = -numbers(vcg.get("TranslationVector"), 4, f"{where}, TranslationVector")[:3]
    possible(checked_translation, center, "its pose")
    scale = np.cbrt(np.linalg.det(layer[:3, :3]))
    in_mesh = rotation(R, where) @ rotation(layer[:3, :3] / scale, f"{where}, MLMatrix44")
    center_in_mesh = np.linalg.solve(layer[:3, :3], center - layer[:3, 3])
    pose = pose_at(Y_AND_Z_FLIPPED @ in_mesh, center_in_mesh)
    return ForeignCamera(name, Camera(_intrinsics(vcg, where), pose), _notes(vcg, where))


def _intrinsics(vcg: ET.Element, where: str) -> Intrinsics:
    width, height = numbers(vcg.get("ViewportPx"), 2, f"{where}, ViewportPx")
    if min(width, height) < 1:
        raise Unusable(
            f"it has no camera there (its viewport is {width:g} x {height:g}); align it in MeshLab"
            " and save the project again"
        )
    focal = numbers(vcg.get("FocalMm"), 1, f"{where}, FocalMm")
    size = numbers(vcg.get("PixelSizeMm"), 2, f"{where}, PixelSizeMm")
    cx, cy_up = numbers(vcg.get("CenterPx"), 2, f"{where}, CenterPx")
    if not min(size) > 1 / MOST_SCALE:
        raise Unusable("its pixels have no size")
    return lens(width, height, focal / size, (cx, height - cy_up))


def _notes(vcg: ET.Element, where: str) -> tuple[str, ...]:
    k = numbers(vcg.get("LensDistortion", "0 0"), 2, f"{where}, LensDistortion")
    return ("its lens distortion is ignored, as MeshLab does",) if any(k) else ()


def _attributes(camera: Camera) -> dict[str, str]:
    k = camera.intrinsics
    R = np.eye(4)
    R[:3, :3] = Y_AND_Z_FLIPPED @ camera.pose.R
    return {
        "TranslationVector": words([*-camera.center, 1]),
        "RotationMatrix": words(R.ravel()),
        "LensDistortion": "0 0",
        "ViewportPx": f"{k.width} {k.height}",
        "PixelSizeMm": words([FOCAL_MM / k.fx, FOCAL_MM / k.fy]),
        "CenterPx": words([k.cx, k.height - k.cy]),
        "FocalMm": repr(FOCAL_MM),
        "CameraType": "0",
        "BinaryData": "0",
    }


def _lost(k: Intrinsics) -> str:
    lost = left_out(brown_terms(k))
    off = max(abs(k.cx - k.width / 2), abs(k.cy - k.height / 2))
    moved = f"MeshLab's filters take the principal point as centered: up to {off:.1f} px off"
    return sentences([lost, moved if off > 0.5 else ""])
