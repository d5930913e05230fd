"""openMVG's sfm_data.json: https://openmvg.readthedocs.io (SfM_data format, cameras).

Poses are rotation (cam_from_world, OpenCV's axes) and center. Lenses: pinhole, pinhole_radial_k1,
pinhole_radial_k3 (k1 k2 k3), pinhole_brown_t2 (k1 k2 k3 t1 t2, OpenCV's p1 p2). The principal point
is read as counting from the image corner, as openMVG's own exporter to COLMAP takes it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
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

LOW_BITS = 0x3FFFFFFF
"""cereal marks the first object of each type in the upper bits of its number."""

NAMED_HERE = 0x80000000
"""cereal's mark of an object whose type or content stands here, not earlier in the file."""
WRITTEN = "pinhole_brown_t2"

Lens = Intrinsics | Unusable
DISTORTIONS = {
    "pinhole": ("", 0), "pinhole_radial_k1": ("disto_k1", 1),
    "pinhole_radial_k3": ("disto_k3", 3), "pinhole_brown_t2": ("disto_t2", 5),
}  # fmt: skip


def read_openmvg(path: Path, size_of: SizeOf) -> ForeignModel:
    """The views of a sfm_data.json that have a pose; the others are refused.

    Raises InputError for broken files.
    """
    if path.suffix.lower() == ".bin":
        raise InputError(
            f"{path}: openMVG's binary form; convert it: openMVG_main_ConvertSfM_DataFormat -i"
            " sfm_data.bin -o sfm_data.json -V -I -E"
        )
    content = read_object(path)
    lenses = _lenses(content, path)
    poses = _poses(content, path)
    found, refused = [], {}
    for entry in members(content, "views", f"{path}"):
        view = _data(member(entry, "value", f"{path}, view"), f"{path}, view")
        name = word(view, "filename", f"{path}, view")
        where = f"{path}, {excerpt(name)}"
        pose = poses.get(identity(view, "id_pose", where))
        lens_key = identity(view, "id_intrinsic", where)
        intrinsics = lenses.get(lens_key, Unusable("it has no lens there"))
        if isinstance(pose, Unusable):
            refused[name] = str(pose)
        elif pose is None:
            refused[name] = "it has no pose there"
        elif isinstance(intrinsics, Unusable):
            refused[name] = str(intrinsics)
        else:
            found.append(ForeignCamera(name, Camera(intrinsics, pose)))
    return ForeignModel(tuple(found), refused)


def write_openmvg(shots: Sequence[Shot]) -> Written:
    """sfm_data.json of pinhole_brown_t2 lenses of one focal length; photos of a lens share it."""
    lenses = lenses_of(shots)
    named = {"polymorphic_id": NAMED_HERE + 1, "polymorphic_name": WRITTEN}
    content = {
        "sfm_data_version": "0.3", "root_path": "",
        "views": [
            {"key": i, "value": {"polymorphic_id": 1 << 30, "ptr_wrapper": {
                "id": NAMED_HERE + 1 + i, "data": _view(i, lenses.index(s.camera.intrinsics), s),
            }}}
            for i, s in enumerate(shots)
        ],
        "intrinsics": [
            {"key": i, "value": {
                **(named if not i else {"polymorphic_id": 1}),
                "ptr_wrapper": {"id": NAMED_HERE + 1 + len(shots) + i, "data": _written_lens(k)},
            }}
            for i, k in enumerate(lenses)
        ],
        "extrinsics": [
            {"key": i, "value": {
                "rotation": s.camera.pose.R.tolist(), "center": s.camera.center.tolist(),
            }}
            for i, s in enumerate(shots)
        ],
        "structure": [], "control_points": [],
    }  # fmt: skip
    return Written.of(
        {"sfm_data.json": (json.dumps(content, indent=1) + "\n").encode()}, shots, _lost
    )


def _view(number_: int, lens_: int, shot: Shot) -> dict[str, Any]:
    folder, _, name = shot.path.rpartition("/")
    k = shot.camera.intrinsics
    return {
        "local_path": f"{folder}/" if folder else "/", "filename": name, "width": k.width,
        "height": k.height, "id_view": number_, "id_intrinsic": lens_, "id_pose": number_,
    }  # fmt: skip


def _written_lens(k: Intrinsics) -> dict[str, Any]:
    k1, k2, p1, p2, k3 = five(k.dist)
    return {
        "width": k.width, "height": k.height, "focal_length": (k.fx + k.fy) / 2,
        "principal_point": [k.cx, k.cy], DISTORTIONS[WRITTEN][0]: [k1, k2, k3, p1, p2],
    }  # fmt: skip


def _lost(k: Intrinsics) -> str:
    higher = beyond_k3(k)
    return left_out({"fx - fy": k.fx - k.fy, **higher})


def _data(value: Any, where: str) -> dict[str, Any]:
    """The fields of a serialized object, those of its base class among them."""
    data = member(member(value, "ptr_wrapper", where), "data", where)
    if not isinstance(data, dict):
        raise InputError(f"{where}: 'data' must be an object")
    base = data.get("value0")
    return {**base, **data} if isinstance(base, dict) else data


def _lenses(content: dict[str, Any], path: Path) -> dict[str, Lens]:
    lenses: dict[str, Lens] = {}
    names: dict[int, str] = {}
    for entry in members(content, "intrinsics", f"{path}"):
        key = identity(entry, "key", f"{path}, intrinsics")
        where = f"{path}, intrinsic {excerpt(key)}"
        value = member(entry, "value", where)
        if not isinstance(value, dict):
            raise InputError(f"{where}: 'value' must be an object")
        type_number = int(number(value.get("polymorphic_id", 0), where)) & LOW_BITS
        if "polymorphic_name" in value:
            names[type_number] = word(value, "polymorphic_name", where)
        try:
            lenses[key] = _lens(names.get(type_number, "unknown"), _data(value, where), where)
        except Unusable as reason:
            lenses[key] = reason
    return lenses


def _lens(model: str, data: dict[str, Any], where: str) -> Intrinsics:
    if model not in DISTORTIONS:
        raise Unusable(
            f"its lens model {excerpt(model)} is not one of OpenCV's; undistort the photos"
        )
    key, count = DISTORTIONS[model]
    k1, k2, k3, p1, p2 = (*(numbers(data.get(key), count, f"{where}, {key}") if key else ()),
                          *(0.0,) * 5)[:5]  # fmt: skip
    width, height, focal = (
        number(member(data, name, where), f"{where}, {name}")
        for name in ("width", "height", "focal_length")
    )
    center = numbers(member(data, "principal_point", where), 2, f"{where}, principal_point")
    return lens(width, height, focal, center, (k1, k2, p1, p2, k3))


def _poses(content: dict[str, Any], path: Path) -> dict[str, Pose | Unusable]:
    poses: dict[str, Pose | Unusable] = {}
    for entry in members(content, "extrinsics", f"{path}"):
        key = identity(entry, "key", f"{path}, extrinsics")
        where = f"{path}, pose {excerpt(key)}"
        value = member(entry, "value", where)
        rows = [numbers(row, 3, where) for row in members(value, "rotation", where)]
        center = numbers(member(value, "center", where), 3, f"{where}, center")
        if len(rows) != 3:
            raise InputError(f"{where}: a rotation of 3 rows expected")
        try:
            poses[key] = pose_at(rotation(rows, where), center)
        except Unusable as reason:
            poses[key] = reason
    return poses
