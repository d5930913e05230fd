"""OpenSfM's reconstruction.json, which OpenDroneMap leaves in its folder opensfm/.

A list of reconstructions. Shots: axis-angle ``rotation`` and ``translation``, cam_from_world with
OpenCV's axes. Image coordinates count from the picture's middle in units of its longer side, pixels
from corners as ours; so do focal lengths (``focal`` or ``focal_x``, ``focal_y``) and ``c_x``,
``c_y``. Lenses: perspective (k1 k2), simple_radial, radial, brown (k1 k2 p1 p2 k3, OpenCV's),
fisheye and fisheye_opencv (opensfm/io.py; features.py, normalized_image_coordinates;
opensfm.org/docs/geometry.html).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import read_json
from texproj.formats.interchange.model import (
    Array,
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    beyond_k3,
    fisheye_terms,
    five,
    left_out,
    lens,
    lenses_of,
    number,
    numbers,
    possible,
)
from texproj.formats.interchange.radial import fisheye
from texproj.formats.interchange.text import member, word

PERSPECTIVE = ("perspective", "simple_radial", "radial", "brown")
FISHEYES = {"fisheye": ("k1", "k2"), "fisheye_opencv": ("k1", "k2", "k3", "k4")}
DISTORTION = ("k1", "k2", "p1", "p2", "k3")
MOST_TURNS_RAD = 1e3
"""Length of an axis-angle rotation beyond which its last digits mean nothing."""
SEVERAL = "its parts have frames of their own; the one with most photos was read"


def read_opensfm(path: Path, size_of: SizeOf) -> ForeignModel:
    """The shots of the largest reconstruction; sizes come from the photos, since OpenDroneMap keeps
    those of its reduced pictures. Raises InputError for broken files.
    """
    content = read_json(path)
    parts = content if isinstance(content, list) else [content]
    if not parts or not all(isinstance(part, dict) for part in parts):
        raise InputError(f"{path}: not a reconstruction of OpenSfM (a list of objects expected)")
    part = max(parts, key=lambda part: len(_table(part, "shots", path)))
    lenses = _table(part, "cameras", path)
    found, refused = [], {}
    for name, shot in _table(part, "shots", path).items():
        where = f"{path}, {excerpt(name)}"
        key = word(shot, "camera", where)
        if key not in lenses:
            raise InputError(f"{where}: camera {excerpt(key)} is not in the file")
        try:
            intrinsics, note = _lens(lenses[key], size_of(name), f"{path}, camera {excerpt(key)}")
            camera = Camera(intrinsics, _pose(shot, where))
            found.append(ForeignCamera(name, camera, (note,) if note else ()))
        except Unusable as reason:
            refused[name] = str(reason)
    notes = (f"{len(parts)} reconstructions: {SEVERAL}",) if len(parts) > 1 else ()
    return ForeignModel(tuple(found), refused, notes=notes)


def write_opensfm(shots: Sequence[Shot]) -> Written:
    """One reconstruction of brown cameras, without points; photos with the same lens share one."""
    lenses = lenses_of(shots)
    content = [{
        "cameras": {_key(i): _camera(k) for i, k in enumerate(lenses)},
        "shots": {
            shot.name: {
                "rotation": Rotation.from_matrix(shot.camera.pose.R).as_rotvec().tolist(),
                "translation": shot.camera.pose.t.tolist(),
                "camera": _key(lenses.index(shot.camera.intrinsics)),
                "orientation": 1,
            }
            for shot in shots
        },
        "points": {},
    }]  # fmt: skip
    text = json.dumps(content, indent=1) + "\n"
    return Written.of({"reconstruction.json": text.encode()}, shots, _lost)


def _table(part: dict[str, Any], key: str, path: Path) -> dict[str, Any]:
    value = member(part, key, f"{path}")
    if not isinstance(value, dict):
        raise InputError(f"{path}: {key!r} must be an object")
    return value


def _pose(shot: Any, where: str) -> Pose:
    turn = numbers(member(shot, "rotation", where), 3, f"{where}, rotation")
    if np.linalg.norm(turn) > MOST_TURNS_RAD:
        raise InputError(f"{where}, rotation: an axis times an angle in radians expected")
    t = numbers(member(shot, "translation", where), 3, f"{where}, translation")
    R: Array = np.asarray(cv2.Rodrigues(turn.reshape(3, 1))[0], np.float64)
    return Pose(R, possible(checked_translation, t, "its pose"))


def _lens(raw: Any, known: tuple[int, int] | None, where: str) -> tuple[Intrinsics, str]:
    told = [number(member(raw, key, where), f"{where}, {key}") for key in ("width", "height")]
    width, height = known if known is not None and _alike(known, told) else told
    longer = max(width, height)

    def value(key: str, default: float = 0.0) -> float:
        return number(raw.get(key, default), f"{where}, {key}")

    kind = str(raw.get("projection_type", "perspective"))
    if "focal" in raw:
        f = (longer * value("focal"),) * 2
    else:
        member(raw, "focal_x", where)
        f = longer * value("focal_x"), longer * value("focal_y", value("focal_x"))
    center = width / 2 + longer * value("c_x"), height / 2 + longer * value("c_y")
    if kind in PERSPECTIVE:
        return lens(width, height, f, center, [value(key) for key in DISTORTION]), ""
    if kind in FISHEYES:
        return fisheye((width, height), f, center, [value(key) for key in FISHEYES[kind]])
    raise Unusable(
        f"its lens model {excerpt(kind)} is not a perspective one; undistort the photos there"
    )


def _alike(known: tuple[int, int], told: Sequence[float]) -> bool:
    """Whether the photo has the shape that the file tells, to a pixel of the smaller one."""
    if not min(told) >= 1:
        return True
    (a, b), (c, d) = known, told
    return abs(a * d - b * c) <= max(a, b, c, d)


def _key(index: int) -> str:
    return f"camera {index}"


def _camera(k: Intrinsics) -> dict[str, Any]:
    longer = max(k.width, k.height)
    return {
        "projection_type": "fisheye_opencv" if k.is_fisheye else "brown",
        "width": k.width, "height": k.height,
        "focal_x": k.fx / longer, "focal_y": k.fy / longer,
        "c_x": (k.cx - k.width / 2) / longer, "c_y": (k.cy - k.height / 2) / longer,
        **(fisheye_terms(k) if k.is_fisheye else dict(zip(DISTORTION, five(k.dist), strict=True))),
    }  # fmt: skip


def _lost(k: Intrinsics) -> str:
    return left_out(beyond_k3(k))
