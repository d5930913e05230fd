"""Reading photos as cameras, scanners and editors write them: pixels, orientation, masks."""

import io
import time
from pathlib import Path

import cv2
import imagecodecs
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageOps

from texproj.errors import InputError
from texproj.formats.photos import PHOTO_SUFFIXES, read_photo, read_photo_info
from texproj.photo import linear_from_srgb


def pattern(height=48, width=72, channels=3):
    """A smooth uint8 picture without symmetry."""
    y, x = np.mgrid[:height, :width]
    waves = [x / width, y / height, 0.5 + 0.4 * np.sin(x / 9 + y / 5), 1 - x / width]
    return np.stack([np.round(255 * wave) for wave in waves[:channels]], axis=-1).astype(np.uint8)


def wide(pixels):
    """The same with 16 bits that 8 bits cannot hold."""
    return pixels.astype(np.uint16) * 257 - (pixels > 128) * np.uint16(77)


def read(path, **options):
    return read_photo(path, read_photo_info(path), **options)


def save(path, image, **options):
    Image.fromarray(image).save(path, **options) if isinstance(image, np.ndarray) else image.save(
        path, **options
    )
    return path


def close(pixels, expected, atol):
    np.testing.assert_allclose(pixels.astype(float), expected, rtol=0, atol=atol)


# --- what stays sRGB, to the bit


def test_eight_bit_files_keep_their_values(tmp_path):
    rgb = pattern()
    for name in ("a.png", "a.tif"):
        photo = read(save(tmp_path / name, rgb))
        assert photo.encoding == "srgb"
        np.testing.assert_array_equal(photo.pixels, rgb)
        assert photo.mask is None
        assert photo.pixels.flags.c_contiguous


def test_a_jpeg_is_as_close_as_its_compression(tmp_path):
    path = save(tmp_path / "a.jpg", pattern(), quality=98, subsampling=0)
    photo = read(path)
    assert photo.encoding == "srgb"
    assert np.abs(photo.pixels.astype(int) - pattern()).mean() < 1
    np.testing.assert_array_equal(photo.pixels, np.asarray(Image.open(path)))


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "a.tif"])
def test_gray_becomes_three_equal_channels(tmp_path, name):
    gray = pattern(channels=1)[..., 0]
    photo = read(save(tmp_path / name, gray, quality=98))
    assert photo.pixels.shape == (48, 72, 3)
    close(photo.pixels, np.repeat(gray[..., None], 3, 2), 3 if name == "a.jpg" else 0)


@pytest.mark.parametrize("compression", [None, "lzw", "zlib", "packbits", "jpeg"])
@pytest.mark.parametrize("planar", ["contig", "separate"])
def test_tiffs_of_every_layout(tmp_path, compression, planar):
    rgb = pattern() if planar == "contig" else np.moveaxis(pattern(), -1, 0).copy()
    tifffile.imwrite(
        tmp_path / "a.tif", rgb, photometric="rgb", planarconfig=planar,
        compression=compression, rowsperstrip=16,
    )  # fmt: skip
    error = np.abs(read(tmp_path / "a.tif").pixels.astype(int) - pattern())
    assert error.mean() < 4 if compression == "jpeg" else error.max() == 0


def test_tiled_big_endian_and_big_tiffs(tmp_path):
    options = {"tiled": {"tile": (32, 32)}, "swapped": {"byteorder": ">"}, "big": {"bigtiff": True}}
    rgb = wide(pattern())
    for name, how in options.items():
        path = tmp_path / f"{name}.tif"
        tifffile.imwrite(path, rgb, photometric="rgb", byteorder=how.pop("byteorder", "<"),
                         bigtiff=how.pop("bigtiff", False), **how)  # fmt: skip
        info = read_photo_info(path)
        assert (info.width, info.height) == (72, 48)
        close(read_photo(path, info).pixels, linear_from_srgb(rgb / 65535), 1e-6)


def test_palettes_and_inverted_grays(tmp_path):
    indexed = Image.fromarray(pattern()).quantize(32)
    expected = np.asarray(indexed.convert("RGB"))
    for name in ("a.png", "a.tif"):
        photo = read(save(tmp_path / name, indexed))
        assert photo.encoding == "srgb"
        np.testing.assert_array_equal(photo.pixels, expected)
    gray = pattern(channels=1)[..., 0]
    tifffile.imwrite(tmp_path / "w.tif", 255 - gray, photometric="miniswhite")
    np.testing.assert_array_equal(read(tmp_path / "w.tif").pixels[..., 0], gray)


def test_one_and_twelve_bits_fill_the_range(tmp_path):
    bits = pattern(channels=1)[..., 0] > 100
    tifffile.imwrite(tmp_path / "one.tif", bits, photometric="minisblack")
    assert set(np.unique(read(tmp_path / "one.tif").pixels)) == {0, 255}
    save(tmp_path / "one.png", Image.fromarray(bits))
    np.testing.assert_array_equal(read(tmp_path / "one.png").pixels[..., 0], bits * 255)
    twelve = np.arange(4096, dtype=np.uint16).reshape(64, 64)
    packed = imagecodecs.packints_encode(twelve, 12)
    tifffile.imwrite(
        tmp_path / "t.tif", iter([packed]), shape=(64, 64), dtype=np.uint16, bitspersample=12,
        photometric="minisblack", rowsperstrip=64,
    )  # fmt: skip
    expected = linear_from_srgb(twelve / 4095)
    close(read(tmp_path / "t.tif").pixels[..., 0], expected, 2e-5)


# --- more than 8 bits


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_sixteen_bits_are_read_as_sixteen_bits(tmp_path, suffix):
    """Every one of the 65536 levels comes out different, linear, and right."""
    levels = np.arange(65536, dtype=np.uint16).reshape(256, 256)
    rgb = np.stack([levels, levels[::-1], levels.T], axis=-1)
    data = imagecodecs.png_encode(rgb)
    path = tmp_path / f"a{suffix}"
    path.write_bytes(data) if suffix == ".png" else tifffile.imwrite(path, rgb, photometric="rgb")
    photo = read(path)
    assert photo.encoding == "linear"
    assert photo.pixels.dtype == np.float32
    assert len(np.unique(photo.pixels[..., 0])) == 65536
    close(photo.pixels, linear_from_srgb(rgb / 65535), 1e-7)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_sixteen_bit_gray_and_alpha(tmp_path, suffix):
    gray, alpha = wide(pattern(channels=1)), np.full((48, 72, 1), 65535, np.uint16)
    alpha[:, :20] = 0
    path = tmp_path / f"a{suffix}"
    both = np.concatenate([gray, alpha], axis=-1)
    if suffix == ".png":
        path.write_bytes(imagecodecs.png_encode(both))
    else:
        tifffile.imwrite(path, both, photometric="minisblack", extrasamples=["unassalpha"])
    photo = read(path)
    close(photo.pixels, linear_from_srgb(np.repeat(gray, 3, 2) / 65535), 1e-7)
    np.testing.assert_array_equal(photo.mask == 0, alpha[..., 0] == 0)


def test_floating_point_tiffs_are_linear_light_without_an_upper_end(tmp_path):
    values = np.array([[[0.0, 0.18, 7.5]]], np.float32)
    tifffile.imwrite(tmp_path / "f.tif", values, photometric="rgb")
    np.testing.assert_array_equal(read(tmp_path / "f.tif").pixels, values)


# --- alpha and masks


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_alpha_becomes_the_mask(tmp_path, name):
    rgba = np.dstack([pattern(), np.full((48, 72), 255, np.uint8)])
    rgba[10:20, 30:50, 3] = 0
    photo = read(save(tmp_path / name, rgba))
    np.testing.assert_array_equal(photo.pixels, rgba[..., :3])
    np.testing.assert_array_equal(photo.mask, rgba[..., 3])


def test_opaque_alpha_is_no_mask(tmp_path):
    rgba = np.dstack([pattern(), np.full((48, 72), 255, np.uint8)])
    assert read(save(tmp_path / "a.png", rgba)).mask is None


def test_stencil_and_alpha_both_forbid(tmp_path):
    rgba = np.dstack([pattern(), np.full((48, 72), 255, np.uint8)])
    rgba[:, :10, 3] = 0
    stencil = np.full((48, 72), 255, np.uint8)
    stencil[:7] = 0
    mask = read(save(tmp_path / "a.png", rgba), mask=save(tmp_path / "m.png", stencil)).mask
    expected = np.minimum(rgba[..., 3], stencil)
    np.testing.assert_array_equal(mask, expected)


MASK_KINDS = {
    "gray": lambda keep: (keep * 255).astype(np.uint8),
    "ones": lambda keep: keep.astype(np.uint8),
    "one bit": Image.fromarray,
    "rgb": lambda keep: (keep[..., None] * np.uint8([255, 0, 90])).astype(np.uint8),
    "alpha alone": lambda keep: np.dstack([np.zeros((*keep.shape, 3)), keep * 255]).astype(
        np.uint8
    ),
    "16 bit": lambda keep: keep.astype(np.uint16),
}


@pytest.mark.parametrize("make", MASK_KINDS.values(), ids=MASK_KINDS.keys())
def test_a_stencil_of_any_kind_forbids_where_it_is_zero(tmp_path, make):
    keep = np.ones((48, 72), bool)
    keep[20:, 40:] = False
    photo = read(save(tmp_path / "a.png", pattern()), mask=save(tmp_path / "m.png", make(keep)))
    np.testing.assert_array_equal(photo.mask > 0, keep)


def test_a_stencil_of_another_resolution_is_resized_without_a_shift(tmp_path):
    keep = np.full((24, 36), 255, np.uint8)
    keep[:, 18:] = 0
    photo = read(save(tmp_path / "a.png", pattern()), mask=save(tmp_path / "m.png", keep))
    np.testing.assert_array_equal(np.flatnonzero(photo.mask[5] == 0), np.arange(36, 72))


def test_a_stencil_of_another_shape_is_refused_with_both_sizes(tmp_path):
    mask = save(tmp_path / "m.png", np.full((72, 48), 255, np.uint8))
    path = save(tmp_path / "a.png", pattern())
    with pytest.raises(InputError, match=r"m\.png: the mask is 48 x 72.*a\.png is 72 x 48"):
        read(path, mask=mask)
    (tmp_path / "m.png").write_bytes(b"")
    with pytest.raises(InputError, match=r"m\.png: the mask is empty"):
        read(path, mask=mask)


# --- orientation


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("name", ["a.jpg", "a.png", "a.tif"])
def test_every_orientation_is_made_upright(tmp_path, name, orientation):
    """Against Pillow's own way of doing it; the mask belongs to the upright picture."""
    exif = Image.Exif()
    exif[274] = orientation
    path = save(tmp_path / name, pattern(), exif=exif, quality=98, subsampling=0)
    expected = np.asarray(ImageOps.exif_transpose(Image.open(path)))
    stencil = np.full(expected.shape[:2], 255, np.uint8)
    stencil[:9, :5] = 0
    info = read_photo_info(path)
    assert (info.width, info.height) == expected.shape[1::-1]
    photo = read_photo(path, info, save(tmp_path / "m.png", stencil))
    np.testing.assert_array_equal(photo.pixels, expected)
    np.testing.assert_array_equal(photo.mask, stencil)


def test_alpha_turns_with_the_picture(tmp_path):
    rgba = np.dstack([pattern(), pattern(channels=4)[..., 3]])
    exif = Image.Exif()
    exif[274] = 6
    photo = read(save(tmp_path / "a.png", rgba, exif=exif))
    np.testing.assert_array_equal(photo.mask, np.rot90(rgba[..., 3], -1))
    np.testing.assert_array_equal(photo.pixels, np.rot90(rgba[..., :3], -1))


# --- reduced size


@pytest.mark.parametrize("longest", [1600, 799, 400, 256, 200, 100, 33, 1])
@pytest.mark.parametrize("size", [(1200, 1600), (1067, 1600), (601, 799)])
def test_reduction_ends_at_exactly_the_size_asked_for_and_shifts_nothing(tmp_path, longest, size):
    """A ramp in x up and down (so that biased values cancel) and one in y read their own position.
    JPEG's own reduction, where sizes leave a rest, would move them by up to half a pixel.
    """
    height, width = size
    x, y = (np.arange(width) + 0.5) / width, (np.arange(height)[:, None] + 0.5) / height
    ramps = np.stack(np.broadcast_arrays(20 + 200 * x, 20 + 200 * y, 220 - 200 * x), axis=-1)
    path = save(tmp_path / "a.jpg", np.round(ramps).astype(np.uint8), quality=97, subsampling=0)
    photo = read(path, longest=longest)
    long = min(longest, width)
    assert (photo.width, photo.height) == (long, max(1, round(height * long / width)))
    assert (photo.info.width, photo.info.height) == (width, height)
    if long >= 100:
        red, green, blue = np.moveaxis(photo.pixels.astype(float), -1, 0)
        shift_x = (red - blue).mean(0) / 400 * long + long / 2 - 0.5 - np.arange(long)
        shift_y = (green.mean(1) - 20) / 200 * photo.height - 0.5 - np.arange(photo.height)
        assert abs(shift_x[4:-4].mean()) < 0.1 * max(1, long / 400)
        assert abs(shift_y[4:-4].mean()) < 0.2 * max(1, photo.height / 200)


def test_the_mask_is_reduced_with_the_photo(tmp_path):
    stencil = np.full((48, 72), 255, np.uint8)
    stencil[:, 36:] = 0
    mask = save(tmp_path / "m.png", stencil)
    photo = read(save(tmp_path / "a.jpg", pattern()), mask=mask, longest=18)
    assert photo.mask.shape == photo.pixels.shape[:2] == (12, 18)
    np.testing.assert_array_equal(np.flatnonzero(photo.mask[0] == 0), np.arange(9, 18))


# --- damaged and foreign files


def jpeg_bytes(pixels, **options):
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "JPEG", **options)
    return out.getvalue()


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize("kept", [0.3, 0.6, 0.95])
@pytest.mark.parametrize("longest", [None, 50])
def test_a_truncated_photo_is_refused(tmp_path, suffix, kept, longest, capfd):
    """Half-gray pictures must not pass for photos."""
    noise = np.random.default_rng(0).integers(0, 256, (256, 400, 3)).astype(np.uint8)
    whole = save(tmp_path / f"whole{suffix}", noise)
    data = whole.read_bytes()
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(data[: int(len(data) * kept)])
    with pytest.raises(InputError, match=f"cut{suffix}"):
        read(path, longest=longest)
    path.write_bytes(data[: int(len(data) * kept)] + bytes(len(data) // 2))
    if suffix == ".jpg":
        with pytest.raises(InputError, match=f"cut{suffix}"):
            read(path, longest=longest)


def test_a_truncated_progressive_or_cmyk_jpeg_is_refused(tmp_path, capfd):
    noise = np.random.default_rng(0).integers(0, 256, (256, 400, 3)).astype(np.uint8)
    inks = Image.fromarray(noise).convert("CMYK")
    save(tmp_path / "p.jpg", noise, progressive=True)
    save(tmp_path / "c.jpg", inks)
    for name in ("p.jpg", "c.jpg"):
        data = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(data[: len(data) * 2 // 3])
        with pytest.raises(InputError, match="damaged"):
            read(tmp_path / name)


def test_bytes_after_the_end_of_a_jpeg_are_harmless(tmp_path):
    """Phones append second pictures, maps and films."""
    data = jpeg_bytes(pattern(), quality=98)
    (tmp_path / "a.jpg").write_bytes(data + data[: len(data) // 2] + b"trailer" * 50)
    np.testing.assert_array_equal(
        read(tmp_path / "a.jpg").pixels, np.asarray(Image.open(io.BytesIO(data)))
    )


def test_a_multi_picture_file_of_a_phone_is_its_first_picture(tmp_path):
    first, second = Image.fromarray(pattern()), Image.fromarray(255 - pattern())
    first.save(tmp_path / "a.jpg", "MPO", save_all=True, append_images=[second], quality=98)
    assert np.abs(read(tmp_path / "a.jpg").pixels.astype(int) - pattern()).mean() < 3


@pytest.mark.parametrize("name", ["p.jpg", "c.jpg", "p.png", "p.tif"])
def test_spoiled_files_are_read_or_refused_but_never_crash(tmp_path, name, capfd):
    """Bytes replaced, removed and inserted at random, mostly in the header."""
    exif = Image.Exif()
    exif[271], exif[274] = "maker", 6
    image = Image.fromarray(pattern()).convert("CMYK" if name[0] == "c" else "RGB")
    save(tmp_path / name, image, exif=exif, icc_profile=imagecodecs.cms_profile("adobergb"))
    data = (tmp_path / name).read_bytes()
    rng = np.random.default_rng(ord(name[-1]))
    for _ in range(60):
        spoiled = bytearray(data)
        for _ in range(3):
            at = int(rng.integers(400 if rng.random() < 0.6 else len(data)))
            spoiled[at : at + int(rng.integers(9))] = rng.bytes(int(rng.integers(9)))
        (tmp_path / name).write_bytes(spoiled)
        try:
            read(tmp_path / name)
        except InputError as error:
            assert "\n" not in str(error)


FOREIGN = {
    "zero.jpg": (b"", "is empty"),
    "zeros.jpg": (bytes(4096), "is empty"),
    "text.jpg": (b"Dear reader, this is no photo at all.\n" * 9, "but text"),
    "noise.jpg": (np.random.default_rng(0).bytes(4096), "unknown format"),
    "head.jpg": (b"\xff\xd8\xff\xe0\x00\x10JFIF\x00\x01", "damaged"),
    "head.png": (b"\x89PNG\r\n\x1a\n\x00\x00", "damaged"),
    "head.tif": (b"II*\x00\x08\x00\x00\x00", "TIFF"),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_what_is_no_photo_is_refused_by_the_header(tmp_path, name):
    data, says = FOREIGN[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=says) as error:
        read_photo_info(tmp_path / name)
    assert name in str(error.value)
    assert "\n" not in str(error.value)


def test_missing_photos_and_other_image_formats(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_photo_info(tmp_path / "none.jpg")
    Image.fromarray(pattern()).save(tmp_path / "a.jpg", "GIF")
    with pytest.raises(InputError, match="a GIF image; convert it"):
        read_photo_info(tmp_path / "a.jpg")


def test_a_png_named_jpg_is_read_as_what_it_is(tmp_path):
    Image.fromarray(pattern()).save(tmp_path / "a.jpg", "PNG")
    np.testing.assert_array_equal(read(tmp_path / "a.jpg").pixels, pattern())


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "a.tif"])
def test_a_photo_of_one_pixel_is_read(tmp_path, name):
    photo = read(save(tmp_path / name, np.full((1, 1, 3), 77, np.uint8)))
    assert photo.pixels.shape == (1, 1, 3)
    close(photo.pixels, 77, 1)


def test_the_suffixes_are_those_of_the_project_folder():
    assert {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".dng", ".heic", ".exr"} < set(PHOTO_SUFFIXES)
    assert isinstance(PHOTO_SUFFIXES, tuple)


def test_a_six_megapixel_jpeg_takes_a_fraction_of_a_second(real_data):
    """Processor time, bounds generous for busy machines."""
    path = sorted((Path(real_data("fountain-P11")) / "photos").glob("*.jpg"))[0]
    read(path)
    start = time.process_time()
    photo = read(path)
    assert time.process_time() - start < 0.3
    assert photo.pixels.shape == (2048, 3072, 3)
    reduced = read(path, longest=768)
    whole = cv2.resize(photo.pixels, (768, 512), interpolation=cv2.INTER_AREA)
    assert np.abs(reduced.pixels.astype(int) - whole).mean() < 1


@pytest.mark.parametrize("orientation", [6, 8])
def test_a_mask_painted_on_the_stored_picture_is_turned_with_it(tmp_path, orientation):
    """Its shape tells: that of the photo as stored, not as shown."""
    upright = pattern()
    stencil = np.zeros(upright.shape[:2], np.uint8)
    stencil[:10, :20] = 255
    stored = {6: 1, 8: -1}[orientation]
    exif = Image.Exif()
    exif[274] = orientation
    save(tmp_path / "a.jpg", np.rot90(upright, stored), exif=exif)
    save(tmp_path / "m.png", np.rot90(stencil, stored))

    photo = read(tmp_path / "a.jpg", mask=tmp_path / "m.png")
    assert photo.pixels.shape == upright.shape
    np.testing.assert_array_equal(photo.mask > 0, stencil > 0)
