"""OpenMVS's exchange file (.mvs that begins with MVSI), versions 1 to 7, as its importers write it.

Platforms hold cameras (K, rotation R and position C on the platform) and poses (R, C of the
platform): cam_from_world is ``R_camera R_pose`` about ``R_pose^T C_camera + C_pose``, with OpenCV's
axes, without distortion. Integer pixels are centers, half a pixel from our corners; where no
resolution is told, K is in units of the longer side (libs/MVS/Interface.h). Points, meshes and all
that follows the images are not read.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.documents import read_bytes
from texproj.formats.interchange.model import (
    LARGEST,
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
    lenses_of,
    pose_at,
    rotation,
)

MAGIC = b"MVSI"
OWN_PROJECT = b"MVS\0"
NEWEST, WRITTEN = 7, 6
HALF_PIXEL = 0.5
NO_ID = 0xFFFFFFFF
LONGEST_NAME = 4096


@dataclass(frozen=True, eq=False)
class _Mounted:
    """A camera on a platform."""

    width: int
    height: int
    K: Array
    R: Array
    C: Array


@dataclass(frozen=True, eq=False)
class _Platform:
    cameras: list[_Mounted]
    poses: list[tuple[Array, Array]]


def read_openmvs(path: Path, size_of: SizeOf) -> ForeignModel:
    """The images of an exchange file. Raises InputError for broken files, other kinds of .mvs."""
    data = _Bytes(path)
    head = data.raw(4)
    if head != MAGIC:
        raise InputError(
            f"{path}: not an exchange file of OpenMVS ({MAGIC.decode()} first); give the .mvs that"
            " the importer wrote (InterfaceCOLMAP, InterfaceOpenMVG), or export it with"
            " TransformScene --export-type mvs"
        )
    version, _ = data.whole("II")
    if not 1 <= version <= NEWEST:
        raise InputError(f"{path}: version {version}; versions 1 to {NEWEST} are read")
    platforms = [_platform(data, version) for _ in range(data.count(8))]
    found, refused, absent = [], {}, []
    for _ in range(data.count(20)):
        name, *where_at = _image(data, version)
        try:
            camera = _camera(name, where_at, platforms, size_of(name), f"{path}, {excerpt(name)}")
        except Unusable as reason:
            refused[name] = str(reason)
            continue
        if camera is None:
            absent.append(name)
        else:
            found.append(camera)
    return ForeignModel(tuple(found), refused, tuple(absent))


def write_openmvs(shots: Sequence[Shot]) -> Written:
    """cameras.mvs without points: one platform per lens, poses on it, and the photos' paths."""
    lenses = lenses_of(shots)
    out = [MAGIC, struct.pack("<II", WRITTEN, 0), struct.pack("<Q", len(lenses))]
    images: list[tuple[Shot, int, int]] = []
    for i, k in enumerate(lenses):
        mounted = [shot for shot in shots if shot.camera.intrinsics == k]
        images += [(shot, i, number) for number, shot in enumerate(mounted)]
        K = k.K - np.array([[0, 0, HALF_PIXEL], [0, 0, HALF_PIXEL], [0, 0, 0]])
        out += [_name(f"lens {i}"), struct.pack("<Q", 1), _name(""), _name("")]
        out += [struct.pack("<II", k.width, k.height), _doubles(K), _doubles(np.eye(3))]
        out += [_doubles(np.zeros(3)), struct.pack("<Q", len(mounted))]
        out += [_doubles(s.camera.pose.R) + _doubles(s.camera.center) for s in mounted]
    out.append(struct.pack("<Q", len(images)))
    for shot, platform, pose in images:
        out += [_name(shot.path), _name(""), struct.pack("<IIII", platform, 0, pose, platform)]
    out.append(struct.pack("<6Q", *[0] * 6))  # points, normals, colors, lines, theirs
    box = [*np.eye(4).ravel(), *np.eye(3).ravel(), *np.zeros(6)]
    out.append(_doubles(np.array(box)))
    return Written.of({"cameras.mvs": b"".join(out)}, shots, _lost)


class _Bytes:
    """A cursor over a little-endian file."""

    def __init__(self, path: Path) -> None:
        self.path, self.data, self.at = path, read_bytes(path), 0

    def raw(self, size: int) -> bytes:
        if self.at + size > len(self.data):
            raise InputError(f"{self.path}: ends in the middle; copy it again")
        self.at += size
        return self.data[self.at - size : self.at]

    def whole(self, kinds: str) -> tuple[int, ...]:
        values = struct.Struct(f"<{kinds}")
        return values.unpack(self.raw(values.size))

    def count(self, smallest: int) -> int:
        """How many things follow, each of so many bytes or more."""
        (count,) = self.whole("Q")
        if count * smallest > len(self.data) - self.at:
            raise InputError(f"{self.path}: ends in the middle; copy it again")
        return count

    def doubles(self, *shape: int) -> Array:
        values = np.frombuffer(self.raw(8 * int(np.prod(shape))), "<f8").reshape(shape)
        if not np.isfinite(values).all() or np.abs(values).max() > LARGEST:
            raise InputError(f"{self.path}: a number of a camera or pose is none that can be")
        return values

    def name(self) -> str:
        (size,) = self.whole("Q")
        if size > LONGEST_NAME:
            raise InputError(f"{self.path}: a name of {size} bytes; copy the file again")
        return self.raw(size).decode("utf-8", "replace")


def _platform(data: _Bytes, version: int) -> _Platform:
    data.name()
    cameras = []
    for _ in range(data.count(8)):
        data.name()
        if version > 3:
            data.name()  # of the band
        width, height = data.whole("II")
        cameras.append(
            _Mounted(width, height, data.doubles(3, 3), data.doubles(3, 3), data.doubles(3))
        )
    poses = [(data.doubles(3, 3), data.doubles(3)) for _ in range(data.count(96))]
    return _Platform(cameras, poses)


def _image(data: _Bytes, version: int) -> tuple[str, int, int, int]:
    """Name, and the numbers of platform, camera and pose."""
    name = data.name()
    if version > 4:
        data.name()  # of the mask
    platform, camera, pose = data.whole("III")
    if version > 2:
        data.whole("I")
    if version > 6:
        data.raw(12)  # depths
        data.raw(24 * data.count(24))  # scores of other images
    return name, platform, camera, pose


def _camera(
    name: str, where_at: list[int], platforms: Sequence[_Platform],
    known: tuple[int, int] | None, where: str,
) -> ForeignCamera | None:  # fmt: skip
    """The camera of an image; None where its size is neither in the file nor at hand."""
    on, camera, pose = where_at
    if pose == NO_ID:
        raise Unusable("it has no pose there")
    if on >= len(platforms) or camera >= len(platforms[on].cameras):
        raise InputError(f"{where}: its camera is not in the file")
    if pose >= len(platforms[on].poses):
        raise InputError(f"{where}: its pose is not in the file")
    mounted, (R_pose, C_pose) = platforms[on].cameras[camera], platforms[on].poses[pose]
    told = mounted.width > 0 and mounted.height > 0
    if not told and known is None:
        return None
    size = (mounted.width, mounted.height) if told else known
    R = rotation(mounted.R, where) @ rotation(R_pose, where)
    center = R_pose.T @ mounted.C + C_pose
    return ForeignCamera(name, Camera(_lens(mounted.K, size or (0, 0), told), pose_at(R, center)))


def _lens(K: Array, size: tuple[int, int], told: bool) -> Intrinsics:
    if K[0, 1]:
        raise Unusable(f"its lens is skewed by {K[0, 1]:.3g} px, which OpenCV's model cannot hold")
    if told:
        return lens(*size, (K[0, 0], K[1, 1]), (K[0, 2] + HALF_PIXEL, K[1, 2] + HALF_PIXEL))
    longer = max(size)
    center = K[0, 2] * longer + HALF_PIXEL, K[1, 2] * longer + HALF_PIXEL
    return lens(*size, (K[0, 0] * longer, K[1, 1] * longer), center)


def _name(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<Q", len(data)) + data


def _doubles(values: Array) -> bytes:
    return values.astype("<f8").tobytes()


def _lost(k: Intrinsics) -> str:
    named = brown_terms(k)
    return left_out({**named, **beyond_k3(k)})
