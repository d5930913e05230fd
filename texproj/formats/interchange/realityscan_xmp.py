"""RealityScan's (RealityCapture's) XMP sidecars: one file beside each photo, in a folder.

Rotation is cam_from_world by rows with OpenCV's axes, Position the projection center; focal length
and principal point are in units of the longer side (35 mm: over 36), the latter from the image
center; K = [[f, skew, cx], [0, f aspect, cy]]; distortion k1 k2 k3 k4 t1 t2 ("RealityCapture XMP
camera math", support.capturingreality.com). What t1 and t2 multiply is not told there: they are
taken as OpenCV's p1 and p2.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.documents import read_xml
from texproj.formats.interchange.model import (
    ForeignCamera,
    ForeignModel,
    SizeOf,
    Unusable,
    lens,
    number,
    numbers,
    pose_at,
    rotation,
    sentences,
)
from texproj.formats.interchange.radial import with_fourth_order

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
