"""HEIC by pillow-heif (an extra: it weighs 26 MB), AVIF by Pillow and imagecodecs.

Both are files of boxes (ISO/IEC 23008-12). Their own turns are applied, EXIF's orientation is not,
as the standard has it; libheif turns the pixels itself, for AVIF Pillow tells EXIF's number.
"""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np

from texproj.errors import InputError
from texproj.formats.foreign import Broken
from texproj.formats.photos.exif import directories_of, quiet, read_or_none
from texproj.formats.photos.icc import D65, SRGB_PRIMARIES
from texproj.formats.photos.raster import Raster, Stored, Tags, Values
from texproj.photo import linear_from_srgb

BRANDS = {b"crx ": "RAW", b"avif": "AVIF", b"avis": "AVIF"} | dict.fromkeys(
    (b"heic", b"heix", b"hevc", b"hevx", b"heim", b"heis", b"mif1", b"msf1"), "HEIC"
)
"""Kinds by the brand of a file of boxes."""
HEAD_BYTES = 1 << 20
"""Within which a file's color description stands."""

PRIMARIES = {
    1: SRGB_PRIMARIES, 9: (0.708, 0.292, 0.170, 0.797, 0.131, 0.046),
    12: (0.680, 0.320, 0.265, 0.690, 0.150, 0.060),
}  # fmt: skip
"""Primaries by their number in ITU-T H.273, all with the white D65: sRGB, BT.2020, Display P3."""
HDR = {16: "PQ", 18: "HLG"}
"""Transfer characteristics of pictures for brighter screens (H.273)."""
UNSPECIFIED = 2
CURVE_POINTS = 4096
"""Of the sRGB curve in a profile."""


def brand_of(start: bytes) -> str | None:
    """The kind of a file of boxes by its first 64 bytes, None for videos and others."""
    size = min(struct.unpack_from(">I", start)[0], len(start))
    brands = [start[8:12], *(start[at : at + 4] for at in range(16, size, 4))]
    told = [BRANDS[brand] for brand in brands if brand in BRANDS]
    return "AVIF" if "AVIF" in told else told[0] if told else None


def heic_stored(file: io.BufferedIOBase) -> Stored:
    """What the header of a HEIC tells. Raises InputError where its reader is not installed."""
    picture = _opened(file)
    tags, exif = _exif(picture.info.get("exif") or b"")
    profile = picture.info.get("icc_profile") or _profile(file)
    width, height = picture.size
    return Stored("HEIC", width, height, _colors(picture.mode), profile, tags, exif, (), 1)


def heic_raster(data: bytes) -> Raster:
    """Pixels of a HEIC, turned as it says."""
    picture = _opened(io.BytesIO(data))
    values = np.atleast_3d(np.asarray(picture))
    return _split(values)


def avif_stored(file: io.BufferedIOBase) -> Stored:
    """What the header of an AVIF tells."""
    from PIL import Image  # noqa: PLC0415

    with quiet():
        picture = Image.open(file, formats=("AVIF",))
    tags, exif = _exif(picture.info.get("exif") or b"")
    profile = picture.info.get("icc_profile") or _profile(file)
    width, height = picture.size
    return Stored("AVIF", width, height, _colors(picture.mode), profile, tags, exif)


def avif_raster(data: bytes) -> Raster:
    """Pixels of an AVIF as stored; of an animation the first picture."""
    import imagecodecs  # noqa: PLC0415

    values = np.atleast_3d(imagecodecs.avif_decode(data, index=0))
    if values.dtype == np.uint16:
        top = (1 << _depth(data)) - 1
        values = ((values.astype(np.uint32) * 65535 + top // 2) // top).astype(np.uint16)
    return _split(values)


def _split(values: Values) -> Raster:
    count = values.shape[2]
    if count in (2, 4):
        return Raster(np.ascontiguousarray(values[..., :-1]), values[..., -1])
    return Raster(values)


def _opened(file: io.BufferedIOBase) -> Any:
    try:
        import pillow_heif  # noqa: PLC0415
    except ImportError:
        raise MissingReaderError from None
    file.seek(0)
    return pillow_heif.open_heif(file, convert_hdr_to_8bit=False)


class MissingReaderError(InputError):
    """The reader of HEIC is not installed."""

    def __init__(self) -> None:
        super().__init__("HEIC photos need a reader that is not installed: pip install pillow-heif")


def _exif(block: bytes) -> tuple[Tags, Tags]:
    return read_or_none(lambda: directories_of(block))


def _colors(mode: str) -> int:
    return 1 if mode.startswith("L") else 3


def _profile(file: io.BufferedIOBase) -> bytes | None:
    """An ICC profile for the numbers by which the file names its colors; None for sRGB.

    Raises Broken for pictures whose white is not the paper's.
    """
    import imagecodecs  # noqa: PLC0415

    file.seek(0)
    head = file.read(HEAD_BYTES)
    at = head.find(b"colrnclx")
    if at < 0 or len(head) < at + 12:
        return None
    primaries, transfer = struct.unpack_from(">HH", head, at + 8)
    if transfer in HDR:
        raise Broken(f"it is an HDR picture ({HDR[transfer]}): export it for usual screens")
    if primaries in (1, UNSPECIFIED) or primaries not in PRIMARIES:
        return None
    return imagecodecs.cms_profile(
        "rgb",
        whitepoint=D65,
        primaries=PRIMARIES[primaries],
        transferfunction=linear_from_srgb(np.linspace(0, 1, CURVE_POINTS)),
    )


def _depth(data: bytes) -> int:
    """Bits per channel of an AVIF (pixi box)."""
    at = data.find(b"pixi")
    depth = data[at + 9] if at >= 0 and len(data) > at + 9 else 10
    return depth if depth in (10, 12, 16) else 10
