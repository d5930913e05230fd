"""RAW files of cameras, by LibRaw: linear light of the sRGB primaries, 1 = where the sensor ends.

The picture is the part of the sensor that the camera's own JPEG shows where the file tells it, so
that cameras which other programs found from those JPEGs fit.
"""

from __future__ import annotations

import io
import struct
from typing import Any, BinaryIO, cast

import cv2
import numpy as np

from texproj.formats.foreign import Broken
from texproj.formats.photos.exif import (
    EXPOSURE_TIME,
    F_NUMBER,
    FOCAL_35MM,
    FOCAL_MM,
    ISO,
    directories_of,
    read_or_none,
)
from texproj.formats.photos.raster import Raster, Stored, Tags
from texproj.formats.photos.tiff import MAGIC, directories, photo_page
from texproj.options import DevelopOptions

Raw = Any
"""An open rawpy.RawPy."""
Frame = tuple[int, int, int, int]
"""Left, top, width and height of the picture within what LibRaw develops."""

RAW_MAGIC = (
    b"FUJIFILM", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FOVb", b"\0MRM", b"II\x1a\0\0\0HEAP",
)  # fmt: skip
"""First bytes of RAW files that are no TIFF."""
RAW_OF_TIFF_KIN = (b"IIRO", b"IIRS", b"MMOR", b"IIU\0")
HEAD_BYTES = 1 << 20
"""Where the EXIF values of RAW files that are no TIFF stand."""

TIFF_EP = (EXPOSURE_TIME, F_NUMBER, ISO, FOCAL_MM, FOCAL_35MM)
"""What the standard before EXIF (ISO 12234-2) has in the main directory."""

ORIENTATION_OF_FLIP = {0: 1, 3: 3, 5: 8, 6: 6}
"""EXIF's number for LibRaw's."""

PROPHOTO_FROM_SRGB = np.array(
    [[0.529317, 0.330092, 0.140588], [0.098368, 0.873465, 0.028169], [0.016879, 0.117663, 0.865457]]
)
"""LibRaw's (src/tables/colorconst.cpp), white to white: its widest space clips no real color."""
SRGB_FROM_PROPHOTO = np.linalg.inv(PROPHOTO_FROM_SRGB).astype(np.float32) / 65535


def raw_stored(file: io.BufferedIOBase) -> Stored:
    """What the header tells; nothing is developed."""
    with _opened(file) as raw:
        _, _, width, height = _frame(raw.sizes)
        orientation = ORIENTATION_OF_FLIP.get(raw.sizes.flip, 1)
        told = _told_by_libraw(raw)
    tags, exif = read_or_none(lambda: _directories(file))
    beside = {tag: _one(tags[tag]) for tag in TIFF_EP if tag in tags}
    return Stored("RAW", width, height, 3, None, tags, told | beside | exif, (), orientation)


def raw_raster(data: bytes, longest: int | None, develop: DevelopOptions) -> Raster:
    """Developed pixels, float32 linear; at half size where `longest` allows it."""
    with _opened(io.BytesIO(data)) as raw:
        frame = _frame(raw.sizes)
        whole = (raw.sizes.width, raw.sizes.height)
        half = longest is not None and max(frame[2:]) >= 2 * longest and not _odd(frame)
        pixels = _developed(raw, develop, half)  # after which the sizes are others
        expected = tuple((side + 1) // 2 for side in whole) if half else whole
    if pixels.shape[1::-1] != expected:
        raise Broken("its pixels are not square, or its sensor is turned: develop it elsewhere")
    left, top, width, height = (v // 2 for v in frame) if half else frame
    cut = np.ascontiguousarray(pixels[top : top + height, left : left + width])
    return Raster(cv2.transform(cut.astype(np.float32), SRGB_FROM_PROPHOTO))


def raw_preview(data: bytes) -> bytes | None:
    """The JPEG that the camera put into the file; None if there is none."""
    import rawpy  # noqa: PLC0415

    with _opened(io.BytesIO(data)) as raw:
        try:
            thumb = raw.extract_thumb()
        except rawpy.LibRawError:
            return None
    return bytes(thumb.data) if thumb.format == rawpy.ThumbFormat.JPEG else None


def _developed(raw: Raw, develop: DevelopOptions, half: bool) -> Any:
    """(h, w, 3) uint16, linear, nothing made brighter and no highlight invented."""
    import rawpy  # noqa: PLC0415

    return raw.postprocess(
        half_size=half, user_flip=0, gamma=(1, 1), no_auto_bright=True, output_bps=16,
        adjust_maximum_thr=0.0, use_camera_wb=develop.white_balance == "camera",
        output_color=rawpy.ColorSpace.ProPhoto,
    )  # fmt: skip


def _opened(file: io.BufferedIOBase) -> Raw:
    import rawpy  # noqa: PLC0415

    raw = rawpy.RawPy()
    file.seek(0)
    try:
        raw.open_buffer(cast(BinaryIO, file))
    except rawpy.LibRawUnsufficientMemoryError:
        raise MemoryError from None
    except rawpy.LibRawError as error:
        raise Broken(_reason(error)) from None
    return raw


def _reason(error: Exception) -> str:
    given = error.args[0] if error.args else ""
    return f"LibRaw: {given.decode(errors='replace') if isinstance(given, bytes) else given}"


def _frame(sizes: Any) -> Frame:
    """The camera's own crop where it lies within what is developed, else all of that."""
    left, top = sizes.crop_left_margin - sizes.left_margin, sizes.crop_top_margin - sizes.top_margin
    width, height = sizes.crop_width, sizes.crop_height
    inside = left + width <= sizes.width and top + height <= sizes.height
    if min(left, top) >= 0 and inside and 2 * width > sizes.width and 2 * height > sizes.height:
        return left, top, width, height
    return 0, 0, sizes.width, sizes.height


def _odd(frame: Frame) -> bool:
    return any(value % 2 for value in frame)


def _told_by_libraw(raw: Raw) -> Tags:
    told = raw.other
    values = {
        EXPOSURE_TIME: told.shutter_speed, F_NUMBER: told.aperture, ISO: told.iso_speed,
        FOCAL_MM: told.focal_length,
    }  # fmt: skip
    return {tag: value for tag, value in values.items() if value > 0}


def _one(value: Any) -> Any:
    """A fraction as a number, anything else as it is."""
    if isinstance(value, tuple) and len(value) == 2:
        return value[0] / value[1] if value[1] else None
    return value


def _directories(file: io.BufferedIOBase) -> tuple[Tags, Tags]:
    """EXIF values, wherever the maker put them."""
    file.seek(0)
    head = file.read(HEAD_BYTES)
    file.seek(0)
    if head[:4] in MAGIC:
        with photo_page(file) as (page, first, _):
            return directories(page, first)
    if head[:4] in RAW_OF_TIFF_KIN:
        return directories_of((b"MM\0*" if head[:2] == b"MM" else b"II*\0") + head[4:])
    if head.startswith(b"FUJIFILM"):
        at = struct.unpack_from(">I", head, 84)[0]
        return _of_jpeg(head[at:])
    main, _ = directories_of(_box(head, b"CMT1"))
    photo, _ = directories_of(_box(head, b"CMT2"))
    return main, photo


def _of_jpeg(data: bytes) -> tuple[Tags, Tags]:
    from PIL import Image  # noqa: PLC0415

    return directories_of(Image.open(io.BytesIO(data), formats=("JPEG",)).info.get("exif") or b"")


def _box(head: bytes, name: bytes) -> bytes:
    """Content of one of the boxes in which Canon's CR3 keeps its TIFF directories."""
    at = head.find(name)
    if at < 4:
        return b""
    size = struct.unpack_from(">I", head, at - 4)[0]
    return head[at + 4 : at - 4 + size]
