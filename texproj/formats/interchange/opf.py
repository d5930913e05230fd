"""Open Photogrammetry Format 1.0 of Pix4D: https://pix4d.github.io/opf-spec.

A project (.opf) names its files by what they hold. The camera list gives photos their numbers,
input cameras the size of a sensor's pictures, calibrated cameras positions, ``orientation_deg``
(omega, phi, kappa as in `angles`) and lenses: perspective (R1 R2 R3 T1 T2 as OpenCV's k1 k2 k3 p1
p2) or fisheye (`round_lens`). Pixels count from the top-left corner. Positions are in the
processing frame: the project's own, scaled and shifted as the scene reference frame tells.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote, urlsplit

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.interchange.angles import omega_phi_kappa_deg, rotation_of_omega_phi_kappa
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
    lenses_of,
    number,
    numbers,
    pose_at,
    sentences,
)
from texproj.formats.interchange.round_lens import beyond_radial, of_polynomial, polynomial_of
from texproj.formats.interchange.text import identity, member, members, read_object, word
from texproj.version import __version__

Lens = tuple[Intrinsics, str]
"""And a note, empty where there is none."""
Sensors = Mapping[str, Lens | Unusable]
CAMERA_LIST, INPUT, CALIBRATED, FRAME, PROJECT = (
    f"application/opf-{name}+json"
    for name in (
        "camera-list", "input-cameras", "calibrated-cameras", "scene-reference-frame", "project",
    )
)  # fmt: skip
ITEMS = {
    CAMERA_LIST: "camera_list", INPUT: "input_cameras", FRAME: "scene_reference_frame",
    CALIBRATED: "calibration",
}  # fmt: skip
FORMAT_VERSION = "1.0"
FILM_UM = 36_000.0
"""Nominal width of a sensor in what we write; the format wants pixel sizes, nothing follows."""
NO_TIME = "1970-01-01T00:00:00"
"""The format wants a time of exposure: this one says that it is not known."""
LOCAL_FRAME = (
    'ENGCRS["Mesh",EDATUM["Mesh file"],CS[Cartesian,3],AXIS["x",east,ORDER[1]],'
    'AXIS["y",north,ORDER[2]],AXIS["z",up,ORDER[3]],LENGTHUNIT["metre",1]]'
)
BANDS = (("Red", 0.2126), ("Green", 0.7152), ("Blue", 0.0722))
MOST_TERMS = 20
"""Of a fisheye's polynomial; Pix4D writes five."""
MOST_FILES_BESIDE = 200
"""JSON files in the folder that are looked at where the project's own file is not given."""


def read_opf(path: Path, size_of: SizeOf) -> ForeignModel:
    """The calibrated cameras of a project, or of one of its files beside the others.

    Raises InputError for broken files and for projects without calibration.
    """
    parts = _parts(path)
    missing = [ITEMS[kind] for kind in (CALIBRATED, INPUT, CAMERA_LIST) if kind not in parts]
    if missing:
        raise InputError(f"{path}: the project has no {missing[0]}; calibrate it and export again")
    names = {
        identity(camera, "id", f"{parts[CAMERA_LIST]}"): _name_of(camera, parts[CAMERA_LIST])
        for camera in members(read_object(parts[CAMERA_LIST]), "cameras", f"{parts[CAMERA_LIST]}")
    }
    calibrated = parts[CALIBRATED]
    content = read_object(calibrated)
    sensors = _sensors(content, calibrated, _sizes(parts[INPUT]))
    found, refused = [], {}
    for raw in members(content, "cameras", f"{calibrated}"):
        key = identity(raw, "id", f"{calibrated}, camera")
        name = names.get(key, f"camera {key}")
        where = f"{calibrated}, {excerpt(name)}"
        try:
            camera, note = _camera(raw, sensors, where)
            found.append(ForeignCamera(name, camera, (note,) if note else ()))
        except Unusable as reason:
            refused[name] = str(reason)
    return ForeignModel(tuple(found), refused, notes=_notes(parts))


def write_opf(shots: Sequence[Shot]) -> Written:
    """A project of a camera list, input cameras, calibrated cameras and a local frame."""
    lenses = lenses_of(shots)
    number_of = {k: i for i, k in enumerate(lenses, 1)}
    listed = [{"id": i, "uri": quote(shot.path)} for i, shot in enumerate(shots, 1)]
    frame = {"shift": [0.0] * 3, "scale": [1.0] * 3, "swap_xy": False}
    parts: dict[str, dict[str, Any]] = {
        CAMERA_LIST: {"cameras": listed},
        INPUT: {
            "sensors": [_sensor(i, k) for k, i in number_of.items()],
            "captures": [
                _capture(i, number_of[shot.camera.intrinsics]) for i, shot in enumerate(shots, 1)
            ],
        },
        FRAME: {"crs": {"definition": LOCAL_FRAME}, "base_to_canonical": frame},
        CALIBRATED: {
            "sensors": [{"id": i, "internals": _internals(k)} for k, i in number_of.items()],
            "cameras": [
                {
                    "id": i, "sensor_id": number_of[shot.camera.intrinsics],
                    "position": shot.camera.center.tolist(),
                    "orientation_deg": list(omega_phi_kappa_deg(shot.camera.pose.R)),
                }
                for i, shot in enumerate(shots, 1)
            ],
        },
    }  # fmt: skip
    names = {kind: f"{item.replace('_', '-')}.json" for kind, item in ITEMS.items()}
    contents = {"cameras.opf": _project(names)}
    contents |= {
        names[kind]: {"format": kind, "version": FORMAT_VERSION, **part}
        for kind, part in parts.items()
    }
    files = {name: (json.dumps(c, indent=1) + "\n").encode() for name, c in contents.items()}
    return Written.of(files, shots, _lost)


def _parts(path: Path) -> dict[str, Path]:
    """The files of a project by what they hold."""
    content = read_object(path)
    kind = str(content.get("format"))
    if kind != PROJECT and kind not in ITEMS:
        raise InputError(f"{path}: not a file of the Open Photogrammetry Format")
    if kind != PROJECT:
        beside = sorted(path.parent.glob("*.json"))[:MOST_FILES_BESIDE]
        return {told: file for file in beside if (told := _kind(file)) in ITEMS} | {kind: path}
    parts: dict[str, Path] = {}
    for item in members(content, "items", f"{path}"):
        for resource in members(item, "resources", f"{path}, item"):
            told = word(resource, "format", f"{path}, resource")
            if told in ITEMS and told not in parts:
                uri = urlsplit(word(resource, "uri", f"{path}, resource"))
                parts[told] = path.parent / unquote(uri.path).lstrip("/")
    return parts


def _kind(file: Path) -> str:
    try:
        return str(read_object(file).get("format", ""))
    except InputError:
        return ""


def _name_of(camera: Any, path: Path) -> str:
    uri = word(camera, "uri", f"{path}, camera")
    try:
        return unquote(urlsplit(uri).path) or uri
    except ValueError:
        return uri


def _sizes(path: Path) -> dict[str, tuple[float, float]]:
    """Width and height of each sensor's pictures."""
    sizes = {}
    for sensor in members(read_object(path), "sensors", f"{path}"):
        key = identity(sensor, "id", f"{path}, sensor")
        where = f"{path}, sensor {excerpt(key)}, image_size_px"
        width, height = numbers(member(sensor, "image_size_px", where), 2, where)
        sizes[key] = (float(width), float(height))
    return sizes


def _sensors(
    content: dict[str, Any], path: Path, sizes: Mapping[str, tuple[float, float]]
) -> Sensors:
    sensors: dict[str, Lens | Unusable] = {}
    for sensor in members(content, "sensors", f"{path}"):
        key = identity(sensor, "id", f"{path}, sensor")
        where = f"{path}, sensor {excerpt(key)}"
        if key not in sizes:
            raise InputError(f"{where}: not among the input cameras")
        try:
            sensors[key] = _lens(member(sensor, "internals", where), sizes[key], where)
        except Unusable as reason:
            sensors[key] = reason
    return sensors


def _lens(internals: Any, size: tuple[float, float], where: str) -> Lens:
    kind = word(internals, "type", where)
    if kind not in ("perspective", "fisheye"):
        raise Unusable(
            f"its lens is {excerpt(kind)}, neither perspective nor fisheye; export undistorted"
            " photos"
        )
    center = numbers(member(internals, "principal_point_px", where), 2, f"{where}, principal_point")
    if kind == "fisheye":
        matrix = numbers(member(internals, "affine", where), 4, f"{where}, affine")
        given = member(internals, "polynomial", where)
        count = len(given) if isinstance(given, list) else 0
        told = numbers(given, min(max(count, 2), MOST_TERMS), f"{where}, polynomial")
        return of_polynomial(size, matrix.tolist(), center.tolist(), told.tolist())
    f = number(member(internals, "focal_length_px", where), f"{where}, focal_length_px")
    k1, k2, k3 = numbers(member(internals, "radial_distortion", where), 3, f"{where}, radial")
    p1, p2 = numbers(member(internals, "tangential_distortion", where), 2, f"{where}, tangential")
    return lens(*size, f, center, (k1, k2, p1, p2, k3)), ""


def _camera(raw: Any, sensors: Sensors, where: str) -> tuple[Camera, str]:
    key = identity(raw, "sensor_id", where)
    known = sensors.get(key, Unusable("its sensor is not among the calibrated ones"))
    if isinstance(known, Unusable):
        raise known
    intrinsics, note = known
    angles = numbers(member(raw, "orientation_deg", where), 3, f"{where}, orientation_deg")
    position = numbers(member(raw, "position", where), 3, f"{where}, position")
    return Camera(intrinsics, pose_at(rotation_of_omega_phi_kappa(angles), position)), note


def _notes(parts: Mapping[str, Path]) -> tuple[str, ...]:
    path = parts.get(FRAME)
    if path is None:
        return ()
    frame = member(read_object(path), "base_to_canonical", f"{path}")
    shift = numbers(member(frame, "shift", f"{path}"), 3, f"{path}, shift")
    if not shift.any():
        return ()
    return (
        f"positions are in the processing frame, which is the project's shifted by"
        f" {shift.tolist()}; the mesh must be in the same frame",
    )


def _project(names: Mapping[str, str]) -> dict[str, Any]:
    """The container; its numbers follow from the names, so that equal cameras make equal files."""
    numbers_ = {kind: str(uuid.uuid5(uuid.NAMESPACE_URL, name)) for kind, name in names.items()}
    sources = {
        INPUT: (CAMERA_LIST,), CALIBRATED: (INPUT, FRAME), CAMERA_LIST: (), FRAME: (),
    }  # fmt: skip
    return {
        "format": PROJECT, "version": FORMAT_VERSION,
        "id": str(uuid.uuid5(uuid.NAMESPACE_URL, "texproj")),
        "name": "texproj", "description": "Cameras registered by texproj",
        "generator": {"name": "texproj", "version": __version__},
        "items": [
            {
                "id": numbers_[kind], "type": ITEMS[kind],
                "resources": [{"uri": name, "format": kind}],
                "sources": [{"id": numbers_[s], "type": ITEMS[s]} for s in sources[kind]],
            }
            for kind, name in names.items()
        ],
    }  # fmt: skip


def _sensor(number_: int, k: Intrinsics) -> dict[str, Any]:
    return {
        "id": number_, "name": f"lens {number_}", "shutter_type": "global",
        "bands": [{"name": name, "weight": weight} for name, weight in BANDS],
        "image_size_px": [k.width, k.height], "pixel_size_um": FILM_UM / max(k.width, k.height),
        "internals": _internals(k),
    }  # fmt: skip


def _capture(number_: int, sensor: int) -> dict[str, Any]:
    camera = {
        "id": number_, "sensor_id": sensor, "model_source": "user", "pixel_type": "uint8",
        "pixel_range": {"min": 0, "max": 255},
    }  # fmt: skip
    return {
        "id": number_, "rig_model_source": "not_applicable", "cameras": [camera],
        "reference_camera_id": number_, "time": NO_TIME,
    }  # fmt: skip


def _internals(k: Intrinsics) -> dict[str, Any]:
    if k.is_fisheye:
        (c, f), polynomial, _ = polynomial_of(k)
        return {
            "type": "fisheye", "principal_point_px": [k.cx, k.cy], "affine": [c, 0.0, 0.0, f],
            "is_symmetric_affine": k.fx == k.fy, "is_p0_zero": True,
            "polynomial": list(polynomial),
        }  # fmt: skip
    k1, k2, p1, p2, k3 = five(k.dist)
    return {
        "type": "perspective", "principal_point_px": [k.cx, k.cy],
        "focal_length_px": (k.fx + k.fy) / 2, "radial_distortion": [k1, k2, k3],
        "tangential_distortion": [p1, p2],
    }  # fmt: skip


def _lost(k: Intrinsics) -> str:
    if k.is_fisheye:
        return sentences([left_out(beyond_radial(k)), polynomial_of(k)[2]])
    higher = beyond_k3(k)
    return sentences([left_out({"fx - fy": k.fx - k.fy, **higher})])
