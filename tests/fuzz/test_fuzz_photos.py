"""Photos and masks of every kind end in pixels that are numbers, or in one sentence."""

import io
import struct
import tempfile
from functools import cache
from pathlib import Path

import imagecodecs
import numpy as np
import OpenEXR
import pillow_heif
import pytest
import tifffile
from fuzzing import broken_bytes, refused_or_read
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from raw_files import write_dng

from texproj.errors import InputError
from texproj.formats.photos import read_photo, read_photo_info
from texproj.photo import PhotoInfo

PIXELS = np.random.default_rng(0).integers(0, 256, (24, 32, 3)).astype(np.uint8)
FLOATS = np.full((24, 32, 3), 0.5, np.float32)


def tiff(pixels, **options):
    file = io.BytesIO()
    tifffile.imwrite(file, pixels, **options)
    return file.getvalue()


def saved(kind, mode="RGB", **options):
    file = io.BytesIO()
    Image.fromarray(PIXELS).convert(mode).save(file, kind, **options)
    return file.getvalue()


def of_cameras():
    """RAW, HEIC, AVIF and OpenEXR."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_dng(place / "a.dng", FLOATS.astype(float), margin=4)
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": FLOATS}).write(f"{place}/a.exr")
        dng, exr = (place / "a.dng").read_bytes(), (place / "a.exr").read_bytes()
    heic = io.BytesIO()
    pillow_heif.from_bytes("RGB", (32, 24), PIXELS.tobytes()).save(heic)
    deep = PIXELS.astype(np.uint16) * 4
    return dng, exr, heic.getvalue(), saved("AVIF"), imagecodecs.avif_encode(deep, bitspersample=10)


@cache
def sound():
    """Small sound photos of each kind."""
    exif = Image.Exif()
    exif.update({271: "Maker", 272: "Model", 274: 6})
    exif.get_ifd(0x8769).update({0x829A: 0.01, 0x829D: 8.0, 0x8827: 100, 0xA405: 50})
    profile = imagecodecs.cms_profile("adobergb")
    return (
        saved("JPEG", exif=exif, icc_profile=profile),
        saved("JPEG", "CMYK"),
        saved("JPEG", progressive=True),
        saved("PNG", exif=exif, icc_profile=profile),
        saved("PNG", "P"),
        saved("PNG", "LA"),
        saved("PNG", "1"),
        saved("TIFF", exif=exif, compression="tiff_lzw", icc_profile=profile),
        saved("TIFF", "P"),
        tiff(PIXELS.astype(np.uint16) * 257, photometric="rgb", compression="zlib"),
        tiff(FLOATS, photometric="rgb", tile=(16, 16)),
        tiff(PIXELS[..., 0], photometric="miniswhite", bigtiff=True),
        *of_cameras(),
    )


def as_photo(path):
    info = read_photo_info(path, 1.0)
    photo = read_photo(path, info, None, 20, 1.0)
    assert np.isfinite(photo.pixels).all()
    assert max(photo.width, photo.height) <= 20
    assert info.focal_px is None or np.isfinite(info.focal_px)
    assert info.exposure_ev is None or np.isfinite(info.exposure_ev)
    return photo


def as_mask(path):
    photo = path.with_name("photo.png")
    if not photo.exists():
        photo.write_bytes(saved("PNG"))
    return read_photo(photo, PhotoInfo("photo.png", 32, 24), path, largest_mp=1.0)


@given(st.deferred(lambda: broken_bytes(sound(), most=3)))
def test_photos(place, data):
    """Whatever their endings promise."""
    refused_or_read(as_photo, place / "a.tif", data, "read_photo")


@given(st.deferred(lambda: broken_bytes(sound(), most=3)))
def test_masks(place, data):
    """The same files as masks."""
    refused_or_read(as_mask, place / "m.png", data, "read_photo mask")


TAGS = (
    254, 256, 257, 258, 259, 262, 266, 273, 274, 277, 278, 279, 284, 317, 320, 322, 323, 324, 325,
    330, 338, 339, 347, 530, 34665, 34675,
)  # fmt: skip
ODD_TAG = st.tuples(
    st.sampled_from(TAGS),
    st.integers(1, 13),
    st.integers(0, 5),
    st.sampled_from((0, 1, 2, 5, 8, 64, 2**31, 2**32 - 1)),
)


@given(st.lists(ODD_TAG, min_size=1, max_size=4))
def test_tiff_tags(place, odd):
    """Headers whose tags have other types, counts and values."""
    tags = {256: (3, 1, 8), 257: (3, 1, 8), 258: (3, 1, 8), 259: (3, 1, 1), 262: (3, 1, 1),
            273: (4, 1, 400), 277: (3, 1, 1), 278: (3, 1, 8), 279: (4, 1, 64)}  # fmt: skip
    tags |= {tag: (kind, count, value) for tag, kind, count, value in odd}
    entries = b"".join(struct.pack("<HHII", tag, *tags[tag]) for tag in sorted(tags))
    data = b"II*\0\x08\0\0\0" + struct.pack("<H", len(tags)) + entries + b"\0" * 4
    refused_or_read(as_photo, place / "t.tif", data.ljust(464, b"\7"), "read_photo tags")


def png_of(width, height):
    """A PNG header that promises so much, with hardly any pixels."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = b"\x89PNG\r\n\x1a\n"
    for kind, body in ((b"IHDR", head), (b"IDAT", b""), (b"IEND", b"")):
        crc = imagecodecs.zlib_crc32(kind + body)
        chunks += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)
    return chunks


@pytest.mark.parametrize("read", [as_photo, as_mask])
def test_a_picture_beyond_the_limit_is_refused_before_it_is_decoded(place, read):
    """The limit and the setting that lifts it stand in the sentence."""
    path = place / "huge.png"
    path.write_bytes(png_of(100_000, 100_000))
    with pytest.raises(InputError, match=r"huge\.png: 100000 x 100000 .*largest_photo_mp"):
        read(path)


def test_pixels_that_are_no_numbers_are_never_used(place):
    """NaN, infinity and numbers beyond all light: black, and masked."""
    pixels = FLOATS.copy()
    pixels[0, 0], pixels[1, 1, 2], pixels[2, 2], pixels[3, 3] = np.nan, np.inf, 1e30, 5.0
    (place / "nan.tif").write_bytes(tiff(pixels, photometric="rgb"))
    photo = read_photo(place / "nan.tif", read_photo_info(place / "nan.tif"))
    bad = np.zeros((24, 32), bool)
    bad[[0, 1, 2], [0, 1, 2]] = True
    np.testing.assert_array_equal(photo.mask == 0, bad)
    assert not photo.pixels[bad].any()
    np.testing.assert_array_equal(photo.pixels[~bad], pixels[~bad])
    (place / "all.tif").write_bytes(tiff(FLOATS * np.nan, photometric="rgb"))
    with pytest.raises(InputError, match=r"all\.tif: no pixel"):
        read_photo(place / "all.tif", read_photo_info(place / "all.tif"))


def test_a_mask_of_no_numbers_forbids(place):
    """NaN is no permission."""
    stencil = np.ones((24, 32), np.float32)
    stencil[3, 4] = np.nan
    (place / "m.tif").write_bytes(tiff(stencil))
    mask = as_mask(place / "m.tif").mask
    assert mask[3, 4] == 0
    assert np.count_nonzero(mask == 0) == 1


@pytest.mark.parametrize("marked", [True, False])
def test_a_thumbnail_in_front_is_not_the_photo(place, marked):
    """With and without the mark of a reduced picture; what the first one tells of turning stays."""
    path = place / "thumb.tif"
    with tifffile.TiffWriter(path) as writer:
        small = PIXELS[::4, ::4]
        writer.write(small, photometric="rgb", subfiletype=1 if marked else 0,
                     extratags=[(274, "H", 1, 6, True)])  # fmt: skip
        writer.write(PIXELS, photometric="rgb")
    info = read_photo_info(path)
    assert (info.width, info.height) == (24, 32)
    assert any("first picture, 8 x 6" in note for note in info.notes)
    np.testing.assert_array_equal(read_photo(path, info).pixels, np.rot90(PIXELS, -1))


def test_a_palette_of_a_strange_length_is_refused(place):
    """Once it was no table of colors, and nobody looked."""
    data = saved("TIFF", "P")
    tag = struct.pack("<HHI", 320, 3, 768)
    assert data.count(tag) == 1
    (place / "p.tif").write_bytes(data.replace(tag, struct.pack("<HHI", 320, 3, 770)) + b"\0" * 8)
    with pytest.raises(InputError, match=r"p\.tif: the photo is damaged"):
        as_photo(place / "p.tif")


def test_a_photo_below_its_thumbnail_is_found(place):
    """SubIFDs, as cameras and archives write them."""
    path = place / "sub.tif"
    with tifffile.TiffWriter(path) as writer:
        writer.write(PIXELS[::4, ::4], photometric="rgb", subfiletype=1, subifds=1)
        writer.write(PIXELS, photometric="rgb")
    np.testing.assert_array_equal(read_photo(path, read_photo_info(path)).pixels, PIXELS)
