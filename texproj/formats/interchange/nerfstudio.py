"""nerfstudio's transforms.json: https://docs.nerf.studio/quickstart/data_conventions.html.

``transform_matrix`` is world_from_cam with OpenGL's axes (y up, -z forward); pixels and lens as
COLMAP's OPENCV model. ``applied_transform`` tells how the world was turned when the file was made.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
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
    fisheye_terms,
    five,
    left_out,
    lens,
    number,
    numbers,
    pose_at,
    rotation,
)
from texproj.formats.interchange.radial import fisheye, with_fourth_order
from texproj.formats.interchange.text import member, members, read_object, word

FISHEYE = "OPENCV_FISHEYE"
PERSPECTIVE = ("OPENCV", "PERSPECTIVE", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
MIXED = "left out: a file for nerfstudio has one lens model, and other photos have no fisheye"
MOST_SCALE = 1e12
"""By how much a world may be enlarged; numbers far beyond are no scale."""
DISTORTION = ("k1", "k2", "p1", "p2", "k3")


def read_nerfstudio(path: Path, size_of: SizeOf) -> ForeignModel:
    """The frames of a transforms.json, in the world before ``applied_transform``.

    Raises InputError for broken files.
    """
    content = read_object(path)
    undo, notes = _undo(content, path)
    found, refused, absent = [], {}, []
    for i, frame in enumerate(members(content, "frames", f"{path}"), 1):
        name = word(frame, "file_path", f"{path}, frame {i}")
        where = f"{path}, {excerpt(name)}"
        values = {**content, **frame}
        size = _size(values, size_of(name), where)
        if size is None:
            absent.append(name)
            continue
        try:
            intrinsics, note = _intrinsics(values, size, where)
            matrix = undo @ _matrix(member(frame, "transform_matrix", where), where)
            pose = pose_at(_rotation(matrix, where), matrix[:3, 3])
        except Unusable as reason:
            refused[name] = str(reason)
            continue
        found.append(ForeignCamera(name, Camera(intrinsics, pose), (note,) if note else ()))
    return ForeignModel(tuple(found), refused, tuple(absent), notes)


def write_nerfstudio(shots: Sequence[Shot]) -> Written:
    """One frame per photo, each with its own lens; the world is the mesh file's. A file has one
    lens model: where photos of both kinds are there, fisheyes are left out.
    """
    round_ = all(shot.camera.intrinsics.is_fisheye for shot in shots)
    kept = [shot for shot in shots if shot.camera.intrinsics.is_fisheye == round_]
    frames = [_frame(shot) for shot in kept]
    model = FISHEYE if round_ else "OPENCV"
    text = json.dumps({"camera_model": model, "frames": frames}, indent=1) + "\n"
    notes = {shot.name: note for shot in kept if (note := _lost(shot.camera.intrinsics))}
    notes |= {shot.name: MIXED for shot in shots if shot not in kept}
    return Written({"transforms.json": text.encode()}, notes)


def _undo(content: dict[str, Any], path: Path) -> tuple[Array, tuple[str, ...]]:
    """(4, 4) original world from the file's world."""
    undo: Array = np.eye(4)
    notes: list[str] = []
    if "applied_transform" in content:
        applied = _matrix(content["applied_transform"], f"{path}, applied_transform")
        undo = np.asarray(np.linalg.inv(applied), np.float64)
        notes.append("applied_transform is undone: cameras are in the frame of the reconstruction")
    if "applied_scale" in content:
        scale = number(content["applied_scale"], f"{path}, applied_scale")
        if not MOST_SCALE > scale > 1 / MOST_SCALE:
            raise InputError(f"{path}, applied_scale: must be positive, and of possible size")
        undo = undo @ np.diag([1 / scale] * 3 + [1.0])
    return undo, tuple(notes)


def _matrix(rows: Any, where: str) -> Array:
    """(4, 4) of a list of 3 or 4 rows."""
    matrix = np.eye(4)
    if not isinstance(rows, list) or len(rows) not in (3, 4):
        raise InputError(f"{where}: a matrix of 3 or 4 rows expected")
    for i, row in enumerate(rows):
        matrix[i] = numbers(row if isinstance(row, list) else None, 4, where)
    checked_translation(matrix[:3, 3], where)
    size = np.abs(matrix[:3, :3]).max()
    if not np.array_equal(matrix[3], (0, 0, 0, 1)) or not MOST_SCALE > size > 1 / MOST_SCALE:
        raise InputError(f"{where}: not a rigid transform")
    if not np.linalg.det(matrix[:3, :3] / size) > 0:
        raise InputError(f"{where}: not a rigid transform")
    return matrix


def _rotation(world_from_gl: Array, where: str) -> Array:
    scale = np.cbrt(np.linalg.det(world_from_gl[:3, :3]))
    if abs(scale - 1) < 1e-9:
        scale = 1.0
    return Y_AND_Z_FLIPPED @ rotation(world_from_gl[:3, :3] / scale, where).T


def _size(
    values: dict[str, Any], known: tuple[int, int] | None, where: str
) -> tuple[float, float] | None:
    if "w" in values and "h" in values:
        return number(values["w"], f"{where}, w"), number(values["h"], f"{where}, h")
    return known


def _intrinsics(
    values: dict[str, Any], size: tuple[float, float], where: str
) -> tuple[Intrinsics, str]:
    model = _model(values)
    if model not in (*PERSPECTIVE, FISHEYE):
        raise Unusable(
            f"its lens model {excerpt(model)} is not a perspective one; undistort the photos"
        )
    width, height = size

    def value(key: str, default: float = 0.0) -> float:
        return number(values.get(key, default), f"{where}, {key}")

    fx = _focal(values, "x", width, where)
    if fx is None:
        raise InputError(f"{where}: no focal length (fl_x or camera_angle_x)")
    fy = _focal(values, "y", height, where) or fx
    center = value("cx", width / 2), value("cy", height / 2)
    if model == FISHEYE:
        return fisheye(size, (fx, fy), center, [value(key) for key in ("k1", "k2", "k3", "k4")])
    dist = [value(key) for key in DISTORTION]
    return with_fourth_order(lens(width, height, (fx, fy), center, dist), value("k4"))


def _model(values: dict[str, Any]) -> str:
    """The lens model's name; instant-ngp marks fisheyes by a word of its own."""
    if values.get("is_fisheye", False) not in (False, 0, None, "false"):
        return FISHEYE
    return str(values.get("camera_model", "OPENCV"))


def _focal(values: dict[str, Any], axis: str, pixels: float, where: str) -> float | None:
    if f"fl_{axis}" in values:
        return number(values[f"fl_{axis}"], f"{where}, fl_{axis}")
    key = f"camera_angle_{axis}"
    if key not in values:
        return None
    angle_rad = number(values[key], f"{where}, {key}")
    if not 0 < angle_rad < np.pi:
        raise InputError(f"{where}, {key}: an angle between 0 and pi expected")
    return float(pixels / 2 / np.tan(angle_rad / 2))


def _frame(shot: Shot) -> dict[str, Any]:
    k, inverse = shot.camera.intrinsics, shot.camera.pose.inverse
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = inverse.R @ Y_AND_Z_FLIPPED, inverse.t
    return {
        "file_path": shot.path,
        "w": k.width, "h": k.height, "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy,
        **(fisheye_terms(k) if k.is_fisheye else dict(zip(DISTORTION, five(k.dist), strict=True))),
        "transform_matrix": matrix.tolist(),
    }  # fmt: skip


def _lost(k: Intrinsics) -> str:
    return left_out(beyond_k3(k))
