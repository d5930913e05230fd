"""RealityScan's (RealityCapture's) XMP sidecars: one file beside each photo, in a folder.

Rotation is cam_from_world by rows with OpenCV's axes, Position the projection center; focal length
and principal point are in units of the longer side (35 mm: over 36), the latter from the image
center; K = [[f, skew, cx], [0, f aspect, cy]]; distortion k1 k2 k3 k4 t1 t2 ("RealityCapture XMP
camera math", support.capturingreality.com). What t1 and t2 multiply is not told there: they are
taken as OpenCV's p1 and p2.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.documents import read_xml
from texproj.formats.interchange.model import (
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    beyond_k3,
    five,
    left_out,
    lens,
    number,
    numbers,
    pose_at,
    rotation,
    sentences,
    words,
)
from texproj.formats.interchange.radial import with_fourth_order

RDF = "{http://www.w3.org/1999/02/22-rdf-syntax-ns#}"
XCR = "{http://www.capturingreality.com/ns/xcr/1.1#}"
FILM_MM = 36.0
BROWN = ("perspective", "brown3", "brown4", "brown3t2", "brown4t2")
TANGENTIAL = "t1 and t2 are taken as OpenCV's p1 and p2, which RealityScan does not document"


def read_realityscan_xmp(path: Path, size_of: SizeOf) -> ForeignModel:
    """The sidecars in folder `path`; image sizes are the photos'. Sidecars of other programs are
    passed over. Raises InputError for broken files.
    """
    found, refused, absent, georeferenced = [], {}, [], False
    for file in sorted(path.glob("*.xmp")):
        values = _values(file)
        size = size_of(file.stem)
        if "Version" not in values and "Rotation" not in values:
            continue
        if size is None:
            absent.append(file.stem)
            continue
        georeferenced |= values.get("Coordinates", "local") == "absolute"
        try:
            found.append(_camera(file, values, size))
        except Unusable as reason:
            refused[file.stem] = str(reason)
    note = "coordinates are absolute: the mesh must be exported in the same system"
    return ForeignModel(tuple(found), refused, tuple(absent), (note,) if georeferenced else ())


def write_realityscan_xmp(shots: Sequence[Shot]) -> Written:
    """One sidecar a photo, to lie beside it; lens terms beyond k3 are left out."""
    files = {f"{PurePosixPath(shot.name).stem}.xmp": _sidecar(shot.camera) for shot in shots}
    return Written.of(files, shots, _lost)


def _sidecar(camera: Camera) -> bytes:
    k, longer = camera.intrinsics, max(camera.width, camera.height)
    k1, k2, p1, p2, k3 = five(k.dist)
    root = ET.Element("{adobe:ns:meta/}xmpmeta")
    rdf = ET.SubElement(root, f"{RDF}RDF")
    attributes = {
        "Version": "3", "PosePrior": "locked", "Coordinates": "local",
        "DistortionModel": "brown3t2", "FocalLength35mm": repr(k.fx * FILM_MM / longer),
        "Skew": "0", "AspectRatio": repr(k.fy / k.fx),
        "PrincipalPointU": repr((k.cx - k.width / 2) / longer),
        "PrincipalPointV": repr((k.cy - k.height / 2) / longer), "CalibrationPrior": "locked",
        "CalibrationGroup": "-1", "DistortionGroup": "-1",
    }  # fmt: skip
    inner = ET.SubElement(
        rdf, f"{RDF}Description", {f"{XCR}{key}": value for key, value in attributes.items()}
    )
    ET.SubElement(inner, f"{XCR}Rotation").text = words(camera.pose.R.ravel())
    ET.SubElement(inner, f"{XCR}Position").text = words(camera.center)
    ET.SubElement(inner, f"{XCR}DistortionCoeficients").text = words((k1, k2, k3, 0.0, p1, p2))
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8") + b"\n"


def _lost(k: Intrinsics) -> str:
    _, _, p1, p2, _ = five(k.dist)
    higher = beyond_k3(k)
    return sentences([left_out(higher), TANGENTIAL if p1 or p2 else ""])


def _values(file: Path) -> dict[str, str]:
    """What RealityScan's namespace holds, written as attributes or as elements."""
    values: dict[str, str] = {}
    for element in read_xml(file).iter():
        pairs: list[tuple[str, Any]] = [*element.attrib.items(), (element.tag, element.text)]
        for name, value in pairs:
            if "capturingreality.com/ns/xcr" in name and value:
                values[name.rpartition("}")[2]] = value
    return values


def _camera(file: Path, values: dict[str, str], size: tuple[int, int]) -> ForeignCamera:
    if "Rotation" not in values or "Position" not in values:
        raise Unusable("it is not aligned there")
    R = rotation(numbers(values["Rotation"], 9, f"{file}, Rotation"), f"{file}")
    pose = pose_at(R, numbers(values["Position"], 3, f"{file}, Position"))
    intrinsics, note = _lens(file, values, size)
    return ForeignCamera(file.stem, Camera(intrinsics, pose), (note,) if note else ())


def _lens(file: Path, values: dict[str, str], size: tuple[int, int]) -> tuple[Intrinsics, str]:
    model = values.get("DistortionModel", "perspective")
    if model not in BROWN:
        raise Unusable(
            f"its lens model {excerpt(model)} is not a Brown one; export with model brown3"
        )
    if "FocalLength35mm" not in values:
        raise InputError(f"{file}: no FocalLength35mm")

    def value(key: str, default: str = "0") -> float:
        return number(values.get(key, default), f"{file}, {key}")

    (width, height), longer = size, max(size)
    k = numbers(values.get("DistortionCoeficients", "0 0 0 0 0 0"), 6, f"{file}, distortion")
    k1, k2, k3, k4, t1, t2 = k
    f = value("FocalLength35mm") * longer / FILM_MM
    center = np.array([width / 2, height / 2]) + longer * np.array(
        [value("PrincipalPointU"), value("PrincipalPointV")]
    )
    aspect, skew = value("AspectRatio", "1"), value("Skew")
    if skew:
        raise Unusable(f"its lens is skewed by {skew:.3g}, which OpenCV's model has no place for")
    base = lens(width, height, (f, f * aspect), center, (k1, k2, t1, t2, k3))
    intrinsics, note = with_fourth_order(base, k4)
    return intrinsics, sentences([note, TANGENTIAL if t1 or t2 else ""])
