"""BlocksExchange XML of iTwin Capture (ContextCapture), which Metashape and DJI Terra write too.

``Rotation`` is cam_from_world for axes that ``CameraOrientation`` names, as a matrix by rows or as
omega, phi, kappa of its transpose (not of turned axes as in `angles`); ``Center`` the projection
center. The principal point counts from the center of the top-left pixel, half a pixel from our
corner. Focal length in pixels, or in mm of a sensor's longer side or pixel size (ContextCapture
User Guide, "BlocksExchange XML/XMLZ format"). P1 and P2 are taken as OpenCV's p1 and p2, with which
DJI Terra's files agree. Fisheyes have a focal matrix and a polynomial (`round_lens`).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.documents import read_xml
from texproj.formats.interchange.angles import rotation_of_omega_phi_kappa
from texproj.formats.interchange.model import (
    Y_AND_Z_FLIPPED,
    Array,
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
    lenses_of,
    number,
    numbers,
    pose_at,
    rotation,
    sentences,
)
from texproj.formats.interchange.round_lens import beyond_radial, of_polynomial, polynomial_of

HALF_PIXEL = 0.5
MATRIX = tuple(f"M_{row}{column}" for row in range(3) for column in range(3))
ANGLES = ("Omega", "Phi", "Kappa")
DISTORTION = ("K1", "K2", "P1", "P2", "K3")
PERSPECTIVE, FISHEYE = "Perspective", "Fisheye"
FOCAL_MATRIX, POLYNOMIAL = ("M_00", "M_01", "M_10", "M_11"), ("P0", "P1", "P2", "P3", "P4")
IN_PICTURE = {"Right": (1, 0), "Left": (-1, 0), "Down": (0, 1), "Up": (0, -1)}
ORIENTATIONS = (
    "XRightYDown", "XRightYUp", "XLeftYDown", "XLeftYUp",
    "XDownYRight", "XDownYLeft", "XUpYLeft", "XUpYRight",
)  # fmt: skip
TANGENTIAL = "P1 and P2 are taken as OpenCV's p1 and p2, as DJI Terra writes them"
LOCAL = ("local", "LOCAL")
GEOREFERENCED = (
    "the block has a spatial reference system ({}): the mesh must be exported in the same system"
)


def read_blocks_exchange(path: Path, size_of: SizeOf) -> ForeignModel:
    """The photos of all blocks; those without a whole pose are refused. Raises InputError."""
    root = read_xml(path)
    if root.tag != "BlocksExchange":
        raise InputError(f"{path}: not a BlocksExchange file (<{excerpt(root.tag)}> instead)")
    found: list[ForeignCamera] = []
    refused: dict[str, str] = {}
    for i, group in enumerate(root.iterfind("Block/Photogroups/Photogroup"), 1):
        where = f"{path}, photogroup {i}"
        axes = _axes(group.findtext("CameraOrientation", ORIENTATIONS[0]).strip(), where)
        sensor: tuple[Intrinsics, str] | Unusable
        try:
            sensor = _lens(group, where)
        except Unusable as reason:
            sensor = reason
        for photo in group.iterfind("Photo"):
            name = (photo.findtext("ImagePath") or "").strip() or "photo without a path"
            try:
                if isinstance(sensor, Unusable):
                    raise sensor
                found.append(_photo(photo, name, sensor, axes, f"{path}, {excerpt(name)}"))
            except Unusable as reason:
                refused[name] = str(reason)
    return ForeignModel(tuple(found), refused, notes=_notes(root))


def write_blocks_exchange(shots: Sequence[Shot]) -> Written:
    """One block in a local frame; photos with the same lens share a photogroup."""
    root = ET.Element("BlocksExchange", version="2.1")
    block = ET.SubElement(root, "Block")
    ET.SubElement(block, "Name").text = "texproj"
    groups = ET.SubElement(block, "Photogroups")
    for k in lenses_of(shots):
        group = _write_lens(groups, k)
        for i, shot in enumerate(shots):
            if shot.camera.intrinsics == k:
                _write_photo(group, i, shot)
    ET.indent(root)
    content = ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    return Written.of({"blocks.xml": content}, shots, _lost)


def _axes(orientation: str, where: str) -> Array:
    """(3, 3) OpenCV's axes from the camera axes that a word such as XRightYDown names."""
    if orientation not in ORIENTATIONS:
        raise InputError(f"{where}: unknown CameraOrientation {excerpt(orientation)}")
    x, y = (IN_PICTURE[part] for part in orientation[1:].split("Y"))
    two = np.array([x, y], np.float64).T
    return np.block([[two, np.zeros((2, 1))], [np.zeros((1, 2)), np.linalg.det(two)]])


def _text(holder: ET.Element, key: str, where: str) -> float | None:
    text = holder.findtext(key)
    return None if text is None or not text.strip() else number(text.strip(), f"{where}, {key}")


def _lens(group: ET.Element, where: str) -> tuple[Intrinsics, str]:
    kind = group.findtext("CameraModelType", PERSPECTIVE).strip()
    if kind not in (PERSPECTIVE, FISHEYE):
        raise Unusable(
            f"its lens is of type {excerpt(kind)}, neither perspective nor fisheye; export"
            " undistorted photos there"
        )
    width, height = (_text(group, f"ImageDimensions/{key}", where) for key in ("Width", "Height"))
    if width is None or height is None:
        raise InputError(f"{where}: no ImageDimensions")
    skew = _text(group, "Skew", where) or 0.0
    if skew:
        raise Unusable(f"its lens is skewed by {skew:.3g}, which OpenCV's model has no place for")
    told = [_text(group, f"PrincipalPoint/{key}", where) for key in ("x", "y")]
    if told[0] is None and group.find("PrincipalPoint/xmm") is not None:
        raise Unusable("its principal point is in mm; export it in pixels")
    center = [
        side / 2 if at is None else at + HALF_PIXEL
        for side, at in zip((width, height), told, strict=True)
    ]
    if kind == FISHEYE:
        return _round_lens(group, (width, height), center, where)
    f = _focal_px(group, max(width, height), where)
    aspect = _text(group, "AspectRatio", where)
    dist = [_text(group, f"Distortion/{key}", where) or 0.0 for key in DISTORTION]
    fy = f if aspect is None else f * aspect
    return lens(width, height, (f, fy), center, dist), TANGENTIAL if any(dist[2:4]) else ""


def _round_lens(
    group: ET.Element, size: tuple[float, float], center: list[float], where: str
) -> tuple[Intrinsics, str]:
    matrix = group.find("FisheyeFocalMatrix")
    if matrix is None:
        raise Unusable("its fisheye lens has no FisheyeFocalMatrix; export it calibrated")
    rows = _values(matrix, FOCAL_MATRIX, where).tolist()
    told = [_text(group, f"FisheyeDistortion/{key}", where) for key in POLYNOMIAL]
    usual = (0.0, 1.0, 0.0, 0.0, 0.0)
    polynomial = [u if at is None else at for u, at in zip(usual, told, strict=True)]
    return of_polynomial(size, rows, center, polynomial)


def _focal_px(group: ET.Element, longer: float, where: str) -> float:
    in_px = _text(group, "FocalLengthPixels", where)
    if in_px is not None:
        return in_px
    in_mm, sensor = _text(group, "FocalLength", where), _text(group, "SensorSize", where)
    pixel = _text(group, "PixelSize", where)
    if in_mm is None or not (sensor or pixel):
        raise InputError(f"{where}: no focal length (FocalLengthPixels, or mm and SensorSize)")
    return in_mm / pixel if pixel else in_mm / (sensor or 1.0) * longer


def _photo(
    photo: ET.Element, name: str, sensor: tuple[Intrinsics, str], axes: Array, where: str
) -> ForeignCamera:
    pose = photo.find("Pose")
    turned = None if pose is None else pose.find("Rotation")
    place = None if pose is None else pose.find("Center")
    if turned is None or place is None or place.find("x") is None:
        raise Unusable("it has no pose there, or a position alone")
    if turned.find("M_00") is not None:
        R = rotation(_values(turned, MATRIX, where), where)
    elif turned.find("Omega") is not None:
        angles = _values(turned, ANGLES, where)
        R = Y_AND_Z_FLIPPED @ rotation_of_omega_phi_kappa(angles)
    else:
        raise Unusable(
            "its rotation is neither a matrix nor omega, phi, kappa; export one of these"
        )
    intrinsics, note = sensor
    camera = Camera(intrinsics, pose_at(axes @ R, _values(place, ("x", "y", "z"), where)))
    return ForeignCamera(name, camera, (note,) if note else ())


def _values(holder: ET.Element, keys: Sequence[str], where: str) -> Array:
    return numbers([holder.findtext(key) for key in keys], len(keys), f"{where}, {holder.tag}")


def _notes(root: ET.Element) -> tuple[str, ...]:
    systems = {
        (system.findtext("Id") or "").strip(): (system.findtext("Definition") or "").strip()
        for system in root.iterfind("SpatialReferenceSystems/SRS")
    }
    used = [(block.findtext("SRSId") or "").strip() for block in root.iterfind("Block")]
    named = [systems[key] for key in used if key in systems]
    said = [name for name in named if not name.startswith(LOCAL)]
    return (GEOREFERENCED.format(excerpt(said[0])),) if said else ()


def _write_lens(groups: ET.Element, k: Intrinsics) -> ET.Element:
    group = ET.SubElement(groups, "Photogroup")
    size = ET.SubElement(group, "ImageDimensions")
    _write(size, {"Width": k.width, "Height": k.height})
    ET.SubElement(group, "CameraModelType").text = FISHEYE if k.is_fisheye else PERSPECTIVE
    if not k.is_fisheye:
        _write(group, {"FocalLengthPixels": k.fx})
    ET.SubElement(group, "CameraOrientation").text = ORIENTATIONS[0]
    point = ET.SubElement(group, "PrincipalPoint")
    _write(point, {"x": k.cx - HALF_PIXEL, "y": k.cy - HALF_PIXEL})
    if k.is_fisheye:
        (c, f), polynomial, _ = polynomial_of(k)
        rows = dict(zip(FOCAL_MATRIX, (c, 0.0, 0.0, f), strict=True))
        _write(ET.SubElement(group, "FisheyeFocalMatrix"), rows)
        terms = dict(zip(POLYNOMIAL, polynomial, strict=True))
        _write(ET.SubElement(group, "FisheyeDistortion"), terms)
        return group
    bent = ET.SubElement(group, "Distortion")
    _write(bent, dict(zip(DISTORTION, five(k.dist), strict=True)))
    _write(group, {"AspectRatio": k.fy / k.fx, "Skew": 0.0})
    return group


def _write_photo(group: ET.Element, number_: int, shot: Shot) -> None:
    photo = ET.SubElement(group, "Photo")
    ET.SubElement(photo, "Id").text = str(number_)
    ET.SubElement(photo, "ImagePath").text = shot.path
    pose = ET.SubElement(photo, "Pose")
    turned, place = ET.SubElement(pose, "Rotation"), ET.SubElement(pose, "Center")
    _write(turned, dict(zip(MATRIX, shot.camera.pose.R.ravel(), strict=True)))
    _write(place, dict(zip("xyz", shot.camera.center, strict=True)))


def _write(holder: ET.Element, values: dict[str, float]) -> None:
    for key, value in values.items():
        text = str(value) if isinstance(value, int) else repr(float(value))
        ET.SubElement(holder, key).text = text


def _lost(k: Intrinsics) -> str:
    if k.is_fisheye:
        return sentences([left_out(beyond_radial(k)), polynomial_of(k)[2]])
    _, _, p1, p2, _ = five(k.dist)
    higher = beyond_k3(k)
    return sentences([left_out(higher), TANGENTIAL if p1 or p2 else ""])
