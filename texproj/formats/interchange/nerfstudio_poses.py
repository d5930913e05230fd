"""nerfstudio's exported camera lists (ns-export cameras): transforms_train.json, _eval.json.

A list of ``file_path`` and ``transform``, world_from_cam (3 x 4) with OpenGL's axes, in the world
of the training. dataparser_transforms.json tells how that was made: ``transform`` (3 x 4), then
``scale``; it lies beside the trained model and is wanted beside the list. The list tells no lens:
it is taken from the transforms.json of the training beside it, else the camera is only a start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from texproj.camera import Camera, Pose
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import read_json
from texproj.formats.interchange.model import (
    Y_AND_Z_FLIPPED,
    Array,
    ForeignModel,
    SizeOf,
    Unusable,
    number,
    numbers,
    pose_at,
    rotation,
    unknown_lens,
)
from texproj.formats.interchange.text import member, read_object, word

TRAINING, DATAPARSER = "transforms.json", "dataparser_transforms.json"
MOST_SCALE = 1e12
"""By how much a world may be enlarged; numbers far beyond are no scale."""
IN_TRAINING = (
    f"poses are in the world of the training: put {DATAPARSER} of the trained model beside the list"
)


def read_nerfstudio_poses(
    path: Path, size_of: SizeOf, read_training: Callable[[Path, SizeOf], ForeignModel]
) -> ForeignModel:
    """The cameras of a list. read_training: the reader of transforms.json. Raises InputError."""
    content = read_json(path)
    if not isinstance(content, list):
        raise InputError(f"{path}: a list of cameras expected")
    undo, notes = _undo(path.parent / DATAPARSER)
    training = path.parent / TRAINING
    told = read_training(training, size_of).cameras if training.is_file() else ()
    lenses = {PurePosixPath(camera.name).name: camera for camera in told}
    found, refused, absent = [], {}, []
    for i, entry in enumerate(content, 1):
        name = word(entry, "file_path", f"{path}, camera {i}")
        where = f"{path}, {excerpt(name)}"
        size = size_of(name)
        matrix = _matrix(member(entry, "transform", where), where)
        key = PurePosixPath(name).name
        try:
            pose = _pose(undo, matrix, where)
            if key in lenses:
                camera = Camera(lenses[key].camera.intrinsics, pose)
                found.append(replace(lenses[key], name=name, camera=camera))
            elif size is None:
                absent.append(name)
            else:
                found.append(unknown_lens(name, size, pose))
        except Unusable as reason:
            refused[name] = str(reason)
    return ForeignModel(tuple(found), refused, tuple(absent), notes)


def _undo(path: Path) -> tuple[tuple[float, Array], tuple[str, ...]]:
    """Scale and (3, 4) transform that led to the training's world."""
    if not path.is_file():
        return (1.0, np.eye(4)[:3]), (IN_TRAINING,)
    content = read_object(path)
    scale = number(member(content, "scale", f"{path}"), f"{path}, scale")
    if not MOST_SCALE > scale > 1 / MOST_SCALE:
        raise InputError(f"{path}, scale: must be positive, and of possible size")
    matrix = _matrix(member(content, "transform", f"{path}"), f"{path}, transform")
    R = rotation(matrix[:, :3], f"{path}, transform")
    return (scale, np.concatenate([R, matrix[:, 3:]], axis=1)), ()


def _matrix(rows: Any, where: str) -> Array:
    """(3, 4) of a list of 3 or 4 rows."""
    if not isinstance(rows, list) or len(rows) not in (3, 4):
        raise InputError(f"{where}: a matrix of 3 or 4 rows expected")
    matrix = np.stack([numbers(row if isinstance(row, list) else None, 4, where) for row in rows])
    checked_translation(matrix[:3, 3], where)
    return matrix[:3]


def _pose(undo: tuple[float, Array], world_from_gl: Array, where: str) -> Pose:
    scale, applied = undo
    R_gl = rotation(world_from_gl[:, :3], where)
    center = applied[:, :3].T @ (world_from_gl[:, 3] / scale - applied[:, 3])
    return pose_at(Y_AND_Z_FLIPPED @ (applied[:, :3].T @ R_gl).T, center)
