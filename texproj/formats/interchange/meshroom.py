"""Meshroom's (AliceVision's) .sfm in JSON, file versions up to 1.2.x (sfmDataIO/jsonIO.cpp).

All values are texts. Rotation: nine numbers by columns, cam_from_world. Up to 1.2.0 the principal
point counts from the image corner, from 1.2.1 on from its center; from 1.2.2 on the focal length is
in mm of a sensor width.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError, excerpt
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
    rotation,
)
from texproj.formats.interchange.text import identity, member, members, read_object, word

Version = tuple[int, ...]
FROM_CENTER, IN_MM, WRITTEN = (1, 2, 1), (1, 2, 2), (1, 2, 6)
FILM_MM = 36.0
"""Nominal width of the sensor in what we write; only its ratio to the focal length counts."""
DISTORTIONS = {
    "pinhole": 0, "none": 0, "radial1": 1, "radialk1": 1, "radial3": 3, "radialk3": 3, "brown": 5,
}  # fmt: skip
"""Counts of coefficients: k1 k2 k3 t1 t2, or the first of them."""


def read_meshroom(path: Path, size_of: SizeOf) -> ForeignModel:
    """The views of a .sfm that have a pose; the others are refused. Raises InputError."""
    content = read_object(path)
    version = _version(content, path)
    lenses = {
        identity(raw, "intrinsicId", f"{path}"): raw
        for raw in members(content, "intrinsics", f"{path}")
    }
    listed = members(content, "poses", f"{path}", default=[])
    poses = {identity(raw, "poseId", f"{path}"): raw for raw in listed}
    found, refused = [], {}
    for view in members(content, "views", f"{path}"):
        name = word(view, "path", f"{path}, view")
        where = f"{path}, {excerpt(name)}"
        try:
            pose = _pose(poses.get(str(view.get("poseId"))), where)
            intrinsics = _lens(lenses.get(str(view.get("intrinsicId"))), version, where)
            found.append(ForeignCamera(name, Camera(intrinsics, pose)))
        except Unusable as reason:
            refused[name] = str(reason)
    return ForeignModel(tuple(found), refused)


def write_meshroom(shots: Sequence[Shot]) -> Written:
    """cameras.sfm of version 1.2.6, brown lenses of one focal length; photos of a lens share it."""
    lenses = lenses_of(shots)
    content = {
        "version": [str(part) for part in WRITTEN],
        "views": [
            {
                "viewId": str(i), "poseId": str(i), "path": shot.path,
                "intrinsicId": str(1 + lenses.index(shot.camera.intrinsics)),
                "width": str(shot.camera.width), "height": str(shot.camera.height),
            }
            for i, shot in enumerate(shots, 1)
        ],
        "intrinsics": [_written_lens(i, k) for i, k in enumerate(lenses, 1)],
        "poses": [
            {"poseId": str(i), "pose": {"transform": {
                "rotation": _texts(shot.camera.pose.R.T.ravel()),
                "center": _texts(shot.camera.center),
            }, "locked": "1"}}
            for i, shot in enumerate(shots, 1)
        ],
    }  # fmt: skip
    return Written.of(
        {"cameras.sfm": (json.dumps(content, indent=1) + "\n").encode()}, shots, _lost
    )


def _written_lens(number_: int, k: Intrinsics) -> dict[str, Any]:
    k1, k2, p1, p2, k3 = five(k.dist)
    return {
        "intrinsicId": str(number_), "width": str(k.width), "height": str(k.height),
        "sensorWidth": repr(FILM_MM), "sensorHeight": repr(FILM_MM * k.height / k.width),
        "type": "brown", "focalLength": repr((k.fx + k.fy) / 2 * FILM_MM / k.width),
        "pixelRatio": "1", "principalPoint": _texts((k.cx - k.width / 2, k.cy - k.height / 2)),
        "distortionParams": _texts((k1, k2, k3, p1, p2)), "locked": "true",
    }  # fmt: skip


def _texts(values: Iterable[float]) -> list[str]:
    return [repr(float(value)) for value in values]


def _lost(k: Intrinsics) -> str:
    higher = beyond_k3(k)
    return left_out({"fx - fy": k.fx - k.fy, **higher})


def _version(content: dict[str, Any], path: Path) -> Version:
    words = members(content, "version", f"{path}")
    version = tuple(int(number(word, f"{path}, version")) for word in words)
    if version >= (1, 3):
        told = ".".join(map(str, version))
        raise InputError(
            f"{path}: version {told[:20]} of the format is not known; export as COLMAP"
        )
    return version


def _pose(raw: Any, where: str) -> Pose:
    if raw is None:
        raise Unusable("it has no pose there")
    transform = member(member(raw, "pose", where), "transform", where)
    by_columns = numbers(member(transform, "rotation", where), 9, f"{where}, rotation")
    center = numbers(member(transform, "center", where), 3, f"{where}, center")
    return pose_at(rotation(by_columns.reshape(3, 3).T, where), center)


def _lens(raw: Any, version: Version, where: str) -> Intrinsics:
    if raw is None:
        raise Unusable("it has no lens there")
    model = str(raw.get("type", ""))
    if model == "pinhole" and raw.get("distortionType"):
        model = str(raw["distortionType"])
    if model not in DISTORTIONS:
        raise Unusable(
            f"its lens model {excerpt(model)} is not one of OpenCV's; undistort the photos"
        )
    width, height = (
        number(member(raw, key, where), f"{where}, {key}") for key in ("width", "height")
    )
    cx, cy = numbers(member(raw, "principalPoint", where), 2, f"{where}, principalPoint")
    if version >= FROM_CENTER:
        cx, cy = cx + width / 2, cy + height / 2
    count = DISTORTIONS[model]
    given = (
        numbers(raw.get("distortionParams"), count, f"{where}, distortionParams") if count else ()
    )
    k1, k2, k3, p1, p2 = (*given, *(0.0,) * 5)[:5]
    return lens(width, height, _focal(raw, version, width, where), (cx, cy), (k1, k2, p1, p2, k3))


def _focal(raw: dict[str, Any], version: Version, width: float, where: str) -> Any:
    if version >= IN_MM:
        if number(raw.get("pixelRatio", 1), f"{where}, pixelRatio") != 1:
            raise Unusable("its pixels are not square, which is not read from this format")
        focal_mm = number(member(raw, "focalLength", where), f"{where}, focalLength")
        sensor_mm = number(member(raw, "sensorWidth", where), f"{where}, sensorWidth")
        if sensor_mm <= 0:
            raise Unusable("its sensor has no width")
        return focal_mm / sensor_mm * width
    focal = member(raw, "pxFocalLength", where)
    if isinstance(focal, list):
        return numbers(focal, 2, f"{where}, pxFocalLength")
    return number(focal, f"{where}, pxFocalLength")
