"""Frames of ARKit as scanning apps on telephones keep them: one JSON file a photo, in a folder.

Polycam's keyframes/corrected_cameras (or cameras): fx fy cx cy width height, and t_00 .. t_23,
world_from_cam by rows. 3D Scanner App: ``intrinsics`` (3 x 3) and ``cameraPoseARFrame`` (4 x 4),
both by rows. Camera axes are ARKit's (x right, y up, z backward of the lying picture), the world's
y is up; pixels count from the corner (developer.apple.com, ARCamera; nerfstudio, polycam_utils.py).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError
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
    brown_terms,
    left_out,
    lens,
    number,
    numbers,
    pose_at,
    rotation,
)
from texproj.formats.interchange.text import member, read_object

POLYCAM = tuple(f"t_{row}{column}" for row in range(3) for column in range(4))
POSE = "cameraPoseARFrame"
WORLD = "ARKit's world has y up: the mesh must come from the same scan, without being turned"


def read_arkit(path: Path, size_of: SizeOf) -> ForeignModel:
    """The frames in folder `path`; JSON files of other kinds are passed over. Raises InputError."""
    found, refused, absent = [], {}, []
    for file in sorted(path.glob("*.json")):
        frame = read_object(file)
        if POSE not in frame and POLYCAM[0] not in frame:
            continue
        size = _size(frame, size_of(file.stem), file)
        if size is None:
            absent.append(file.stem)
            continue
        try:
            found.append(ForeignCamera(file.stem, _camera(frame, size, file)))
        except Unusable as reason:
            refused[file.stem] = str(reason)
    if not found and not refused and not absent:
        raise InputError(f"{path}: no frame of Polycam or 3D Scanner App in the folder")
    return ForeignModel(tuple(found), refused, tuple(absent), (WORLD,))


def write_arkit(shots: Sequence[Shot]) -> Written:
    """Polycam's cameras, one file a photo, without distortion."""
    files = {}
    for shot in shots:
        k, inverse = shot.camera.intrinsics, shot.camera.pose.inverse
        matrix = np.concatenate([inverse.R @ Y_AND_Z_FLIPPED, inverse.t[:, None]], axis=1)
        frame = {
            "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "width": k.width, "height": k.height,
            **dict(zip(POLYCAM, matrix.ravel().tolist(), strict=True)),
        }  # fmt: skip
        name = f"{PurePosixPath(shot.name).stem}.json"
        files[name] = (json.dumps(frame, indent=1) + "\n").encode()
    return Written.of(files, shots, _lost)


def is_frame(content: Any) -> bool:
    """Whether a JSON value is a frame of one of the apps."""
    return isinstance(content, dict) and (POSE in content or POLYCAM[0] in content)


def _size(
    frame: dict[str, Any], known: tuple[int, int] | None, file: Path
) -> tuple[float, float] | None:
    if "width" not in frame or "height" not in frame:
        return known
    width, height = (number(frame[key], f"{file}, {key}") for key in ("width", "height"))
    return width, height


def _camera(frame: dict[str, Any], size: tuple[float, float], file: Path) -> Camera:
    if POSE in frame:
        matrix = numbers(frame[POSE], 16, f"{file}, {POSE}").reshape(4, 4)[:3]
        K = numbers(member(frame, "intrinsics", f"{file}"), 9, f"{file}, intrinsics").reshape(3, 3)
    else:
        given = [member(frame, key, f"{file}") for key in POLYCAM]
        matrix = numbers(given, 12, f"{file}, t_00 .. t_23").reshape(3, 4)
        fx, fy, cx, cy = (
            number(member(frame, key, f"{file}"), f"{file}, {key}")
            for key in ("fx", "fy", "cx", "cy")
        )
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return Camera(_lens(K, size), _pose(matrix, f"{file}"))


def _lens(K: Array, size: tuple[float, float]) -> Intrinsics:
    return lens(*size, (K[0, 0], K[1, 1]), (K[0, 2], K[1, 2]))


def _pose(world_from_gl: Array, where: str) -> Pose:
    R = Y_AND_Z_FLIPPED @ rotation(world_from_gl[:, :3], where).T
    return pose_at(R, world_from_gl[:, 3])


def _lost(k: Intrinsics) -> str:
    named = brown_terms(k)
    return left_out({**named, **beyond_k3(k)})
