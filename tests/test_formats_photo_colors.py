"""Color profiles of photos: what stays sRGB, what becomes linear light, and with which values."""

import io
import struct
import time

import imagecodecs
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

from texproj.formats.photos import read_photo, read_photo_info
from texproj.formats.photos.icc import adobe_rgb, is_srgb, linear_from_profile, usable
from texproj.photo import linear_from_srgb

XYZ_FROM_SRGB = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)
XYZ_FROM_ADOBE = np.array(
    [[0.57667, 0.18556, 0.18823], [0.29734, 0.62736, 0.07529], [0.02703, 0.07069, 0.99134]]
)
XYZ_FROM_P3 = np.array(
    [[0.48657, 0.26567, 0.19822], [0.22897, 0.69174, 0.07929], [0.0, 0.04511, 1.04394]]
)
"""To D65 XYZ, from IEC 61966-2-1, Adobe RGB (1998) and SMPTE EG 432-1: the tests' own truth."""


def display_p3():
    return imagecodecs.cms_profile(
        "rgb",
        whitepoint=(0.3127, 0.3290),
        primaries=(0.68, 0.32, 0.265, 0.69, 0.15, 0.06),
        transferfunction=linear_from_srgb(np.linspace(0, 1, 4096)),
    )


def gray_gamma(gamma):
    return imagecodecs.cms_profile("gray", whitepoint=(0.3127, 0.3290), gamma=gamma)


def ink_profile():
    """A CMYK profile made by hand: white paper, neutral inks, L* = 100 (1 - K)(1 - mean(C, M, Y)).

    ICC.1:2001, a lut8 of two grid points per ink.
    """
    inks = np.stack(np.meshgrid(*[[0.0, 1.0]] * 4, indexing="ij"), axis=-1).reshape(-1, 4)
    lightness = (1 - inks[:, 3]) * (1 - inks[:, :3].mean(1))
    grid = np.stack([lightness * 255, np.full(16, 128), np.full(16, 128)], axis=1)
    ramp = np.arange(256, dtype=np.uint8).tobytes()
    unit = struct.pack(">9i", *(np.eye(3).ravel() * 65536).astype(int))
    lut = b"mft1\0\0\0\0" + bytes([4, 3, 2, 0]) + unit
    lut += ramp * 4 + np.round(grid).astype(np.uint8).tobytes() + ramp * 3
    white = b"XYZ \0\0\0\0" + struct.pack(">3i", 63190, 65536, 54061)
    name = b"desc\0\0\0\0" + struct.pack(">I", 5) + b"inks\0" + bytes(8 + 3 + 67)
    text = b"text\0\0\0\0none\0"
    blocks = {b"desc": name, b"cprt": text, b"wtpt": white, b"A2B0": lut}
    table, body, at = struct.pack(">I", len(blocks)), b"", 128 + 4 + 12 * len(blocks)
    for tag, block in blocks.items():
        padded = block + bytes(-len(block) % 4)
        table += tag + struct.pack(">II", at + len(body), len(block))
        body += padded
    head = struct.pack(
        ">I4sI4s4s4s", at + len(body), b"lcms", 0x02400000, b"prtr", b"CMYK", b"Lab "
    )
    head += struct.pack(">6H", 2026, 1, 1, 0, 0, 0) + b"acsp" + bytes(28)
    head += struct.pack(">3i", 63190, 65536, 54061)
    return head + bytes(128 - len(head)) + table + body


def colors():
    """Corners and inner colors, uint8 (1, n, 3)."""
    steps = np.linspace(0, 255, 5).astype(np.uint8)
    return np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(1, -1, 3)


def in_linear_srgb(linear, xyz_from_space):
    return linear @ (np.linalg.inv(XYZ_FROM_SRGB) @ xyz_from_space).T


def save_tiff(path, pixels, profile, photometric="rgb"):
    tifffile.imwrite(path, pixels, photometric=photometric, iccprofile=profile)
    return path


def read(path):
    return read_photo(path, read_photo_info(path))


# --- what is sRGB


def other_srgb_profiles():
    yield imagecodecs.cms_profile("srgb")
    yield ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    yield imagecodecs.cms_profile(
        "rgb",
        whitepoint=(0.3127, 0.3290),
        primaries=(0.64, 0.33, 0.30, 0.60, 0.15, 0.06),
        transferfunction=linear_from_srgb(np.linspace(0, 1, 1024)),
    )


@pytest.mark.parametrize("number", range(3))
def test_srgb_is_known_by_what_it_does_not_by_its_name(tmp_path, number):
    profile = list(other_srgb_profiles())[number]
    assert is_srgb(profile)
    path = tmp_path / "a.png"
    Image.fromarray(colors()).save(path, icc_profile=profile)
    photo = read(path)
    assert photo.encoding == "srgb"
    np.testing.assert_array_equal(photo.pixels, colors())


def test_other_spaces_are_not_srgb():
    gamma22 = imagecodecs.cms_profile(
        "rgb", whitepoint=(0.3127, 0.3290),
        primaries=(0.64, 0.33, 0.30, 0.60, 0.15, 0.06), gamma=1.8,
    )  # fmt: skip
    for profile in (adobe_rgb(), display_p3(), gamma22, gray_gamma(1.0), ink_profile()):
        assert not is_srgb(profile)


def test_sixteen_bits_with_an_srgb_profile_are_srgb(tmp_path):
    pixels = colors().astype(np.uint16) * 257 - (colors() > 9) * np.uint16(3)
    photo = read(save_tiff(tmp_path / "a.tif", pixels, imagecodecs.cms_profile("srgb")))
    np.testing.assert_allclose(photo.pixels, linear_from_srgb(pixels / 65535), atol=1e-6)


# --- wide gamuts


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("suffix", [".png", ".tif", ".jpg"])
def test_adobe_rgb_becomes_linear_srgb_with_its_greens_below_zero(tmp_path, suffix, bits):
    """Against the published matrices; a saturated green has red = -0.4, and that is kept."""
    pixels = colors() if bits == 8 else colors().astype(np.uint16) * 257
    path = tmp_path / f"a{suffix}"
    if suffix == ".tif":
        save_tiff(path, pixels, adobe_rgb())
    elif suffix == ".png":
        path.write_bytes(with_png_profile(imagecodecs.png_encode(pixels), adobe_rgb()))
    else:
        pixels = np.repeat(np.repeat(colors(), 16, axis=0), 16, axis=1)
        Image.fromarray(pixels).save(path, quality=100, subsampling=0, icc_profile=adobe_rgb())
    photo = read(path)
    assert photo.encoding == "linear"
    top = 255 if pixels.dtype == np.uint8 else 65535
    expected = in_linear_srgb((pixels / top) ** (563 / 256), XYZ_FROM_ADOBE)
    assert expected.min() < -0.35
    np.testing.assert_allclose(photo.pixels, expected, atol=0.02 if suffix == ".jpg" else 1e-3)


def with_png_profile(data, profile):
    import zlib

    body = b"iCCPx\0\0" + zlib.compress(profile)
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    return data[:33] + chunk + data[33:]


def test_display_p3_of_a_phone(tmp_path):
    path = tmp_path / "a.jpg"
    pixels = np.repeat(np.repeat(colors(), 16, axis=0), 16, axis=1)
    Image.fromarray(pixels).save(path, quality=100, subsampling=0, icc_profile=display_p3())
    photo = read(path)
    expected = in_linear_srgb(linear_from_srgb(pixels / 255), XYZ_FROM_P3)
    assert photo.encoding == "linear"
    np.testing.assert_allclose(photo.pixels, expected, atol=0.02)


def test_a_camera_says_adobe_rgb_by_exif_alone(tmp_path):
    """DCF 2.0: color space uncalibrated and interoperability index R03, no profile."""
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA001] = 0xFFFF
    exif.get_ifd(0x8769)[0xA005] = {1: "R03"}
    path = tmp_path / "_MG_0001.jpg"
    pixels = np.full((16, 16, 3), (0, 255, 0), np.uint8)
    Image.fromarray(pixels).save(path, quality=100, subsampling=0, exif=exif)
    photo = read(path)
    assert photo.encoding == "linear"
    np.testing.assert_allclose(photo.pixels[8, 8], [-0.398, 1.0, -0.043], atol=0.01)


def test_white_stays_white_in_every_space():
    white = np.full((1, 1, 3), 255, np.uint8)
    for profile in (adobe_rgb(), display_p3()):
        np.testing.assert_allclose(linear_from_profile(white, profile), 1, atol=2e-3)


def test_the_fast_path_is_the_color_engine():
    """Curves and matrix against the engine itself on random colors, 8 and 16 bits."""
    rng = np.random.default_rng(0)
    for profile in (adobe_rgb(), display_p3()):
        for top, dtype in ((256, np.uint8), (65536, np.uint16)):
            pixels = rng.integers(0, top, (40, 50, 3)).astype(dtype)
            exact = linear_from_profile((pixels / (top - 1)).astype(np.float32), profile)
            np.testing.assert_allclose(linear_from_profile(pixels, profile), exact, atol=2e-4)


def test_a_profiled_six_megapixel_photo_takes_a_fraction_of_a_second():
    pixels = np.random.default_rng(0).integers(0, 256, (2000, 3000, 3)).astype(np.uint8)
    linear_from_profile(pixels[:9], adobe_rgb())
    start = time.process_time()
    linear_from_profile(pixels, adobe_rgb())
    assert time.process_time() - start < 0.5


# --- gray and CMYK


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_gray_with_a_gamma(tmp_path, dtype):
    top = np.iinfo(dtype).max
    gray = np.linspace(0, top, 64).astype(dtype).reshape(8, 8)
    photo = read(save_tiff(tmp_path / "a.tif", gray, gray_gamma(1.8), "minisblack"))
    expected = np.repeat((gray / top)[..., None] ** 1.8, 3, axis=2)
    assert photo.pixels.shape == (8, 8, 3)
    np.testing.assert_allclose(photo.pixels, expected, atol=2e-3)


INKS = np.array(
    [[0, 0, 0, 0], [0, 0, 0, 255], [255, 0, 0, 0], [255, 255, 255, 0], [255, 255, 0, 0]], np.uint8
)


def ink_fields(dtype=np.uint8):
    """(16, 80, 4) five fields of 16 x 16 pixels."""
    scale = np.iinfo(dtype).max // 255
    return np.repeat(np.repeat(INKS[None].astype(dtype) * dtype(scale), 16, 1), 16, 0)


@pytest.mark.parametrize("kind", ["jpg", "tif", "tif16"])
def test_cmyk_goes_through_its_profile(tmp_path, kind):
    """Full cyan alone has L* = 66.7 here, that is Y = 0.362; no ink is white, black is black."""
    path = tmp_path / f"a.{kind[:3]}"
    if kind == "jpg":
        Image.fromarray(ink_fields(), "CMYK").save(path, quality=100, icc_profile=ink_profile())
    else:
        fields = ink_fields(np.uint16 if kind == "tif16" else np.uint8)
        save_tiff(path, fields, ink_profile(), "separated")
    photo = read(path)
    assert photo.encoding == "linear"
    of_lightness = [1, 0, ((200 / 3 + 16) / 116) ** 3, 0, ((100 / 3 + 16) / 116) ** 3]
    np.testing.assert_allclose(
        photo.pixels[8, 8::16], np.repeat(np.array(of_lightness)[:, None], 3, 1), atol=0.012
    )


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_cmyk_without_a_profile_is_a_guess_and_says_so(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    if suffix == ".jpg":
        Image.fromarray(ink_fields(), "CMYK").save(path, quality=100)
    else:
        tifffile.imwrite(path, ink_fields(), photometric="separated")
    info = read_photo_info(path)
    assert any("CMYK" in note for note in info.notes)
    photo = read_photo(path, info)
    expected = [[255, 255, 255], [0, 0, 0], [0, 255, 255], [0, 0, 0], [0, 0, 255]]
    assert photo.encoding == "srgb"
    np.testing.assert_allclose(photo.pixels[8, 8::16].astype(int), expected, atol=3)


# --- profiles that do not help


BAD_PROFILES = {
    "noise": np.random.default_rng(0).bytes(500),
    "cut": adobe_rgb()[:200],
    "gray on rgb": gray_gamma(2.2),
    "cmyk on rgb": ink_profile(),
}


@pytest.mark.parametrize("profile", BAD_PROFILES.values(), ids=BAD_PROFILES.keys())
def test_a_profile_that_does_not_fit_is_left_out_and_noted(tmp_path, profile):
    out = io.BytesIO()
    Image.fromarray(colors()).save(out, "PNG")
    (tmp_path / "a.png").write_bytes(with_png_profile(out.getvalue(), profile))
    info = read_photo_info(tmp_path / "a.png")
    assert any("profile" in note for note in info.notes)
    np.testing.assert_array_equal(read_photo(tmp_path / "a.png", info).pixels, colors())
    assert not usable(profile, 3)
