"""RAW, HEIC, AVIF and OpenEXR photos: linear values, turns, sizes, EXIF; one file per shot."""

import builtins
import io
import time

import imagecodecs
import numpy as np
import OpenEXR
import pillow_heif
import pytest
import rawpy
import tifffile
from PIL import Image
from raw_files import write_dng

from texproj.errors import InputError
from texproj.formats.photos import RAW_SUFFIXES, read_photo, read_photo_info, read_thumbnail
from texproj.intake import one_per_shot
from texproj.options import DevelopOptions
from texproj.photo import linear_from_srgb, srgb_from_linear


def scene(height=64, width=96):
    """A smooth linear picture without symmetry."""
    y, x = np.mgrid[:height, :width] + 0.5
    return np.stack(
        [0.1 + 0.6 * x / width, 0.2 + 0.5 * y / height, 0.15 + 0.3 * (x / width + y / height)], -1
    )


def read(path, longest=None, **develop):
    info = read_photo_info(path)
    return read_photo(path, info, longest=longest, develop=DevelopOptions(**develop))


def inner(pixels):
    """Without the frame in which a mosaic has no neighbors."""
    return np.asarray(pixels, float)[4:-4, 4:-4]


# --- RAW


@pytest.mark.parametrize("neutral", [(1, 1, 1), (0.5, 1, 0.7)])
def test_a_raw_is_linear_light(neutral, tmp_path):
    """Known linear values come back within 1 %, with the balance that the camera set, and equal
    those of a 16-bit TIFF of the same scene.
    """
    photo = read(write_dng(tmp_path / "a.dng", scene(), neutral))
    encoded = np.round(srgb_from_linear(scene()) * 65535).astype(np.uint16)
    tifffile.imwrite(tmp_path / "b.tif", encoded, photometric="rgb")

    assert photo.encoding == "linear"
    np.testing.assert_allclose(inner(photo.pixels), inner(scene()), rtol=0.01, atol=1e-3)
    np.testing.assert_allclose(
        inner(photo.pixels), inner(read(tmp_path / "b.tif").pixels), rtol=0.01, atol=1e-3
    )


def test_noise_of_the_sensor_is_kept_and_adds_no_bias(tmp_path):
    """White noise of 1 % stays noise of that order, and means stay within its standard error."""
    flat = np.full((128, 128, 3), 0.4)
    error = inner(read(write_dng(tmp_path / "a.dng", flat, noise=0.01)).pixels) - 0.4

    assert 0.004 < error.std() < 0.012
    assert np.abs(error.mean((0, 1))).max() < 5 * 0.01 / np.sqrt(error[..., 0].size / 4)


def test_colors_beyond_srgb_are_kept(tmp_path):
    """A green of Adobe RGB is negative red and blue of sRGB's (lindbloom.com), not zero."""
    adobe = np.array([[2.0413690, -0.5649464, -0.3446944], [-0.9692660, 1.8760108, 0.0415560],
                      [0.0134474, -0.1183897, 1.0154096]])  # fmt: skip
    green = np.zeros((32, 32, 3))
    green[..., 1] = 0.5
    found = read(write_dng(tmp_path / "a.dng", green, sensor=adobe)).pixels[16, 16]

    np.testing.assert_allclose(found, (-0.1991, 0.5, -0.0215), atol=0.005)


def test_daylight_is_the_same_for_all_shots(tmp_path):
    """The camera's balance makes gray of this light; daylight leaves its cast, in proportion."""
    neutral = (0.5, 1, 0.7)
    path = write_dng(tmp_path / "a.dng", np.full((32, 32, 3), 0.4), neutral)
    photo = read(path, white_balance="daylight").pixels[16, 16]

    np.testing.assert_allclose(photo / photo[1], neutral, rtol=0.01)


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_a_raw_is_upright(orientation, tmp_path):
    turns = {1: 0, 3: 2, 6: -1, 8: 1}[orientation]
    path = write_dng(tmp_path / "a.dng", scene(), orientation=orientation)
    info = read_photo_info(path)
    photo = read(path)

    assert (info.width, info.height) == (photo.width, photo.height)
    expected = np.rot90(scene(), turns)
    np.testing.assert_allclose(inner(photo.pixels), inner(expected), rtol=0.01, atol=1e-3)


@pytest.mark.parametrize("margin", [0, 8])
def test_a_raw_at_half_size_lies_where_the_whole_lies(margin, tmp_path):
    """Half size is asked of LibRaw, and each pixel is made of its four; red and blue are those
    of their corner, a quarter of a pixel aside.
    """
    path = write_dng(tmp_path / "a.dng", scene(), margin=margin)
    half = read(path, longest=48)

    assert (half.width, half.height) == (48, 32)
    means = scene().reshape(32, 2, 48, 2, 3).mean((1, 3))
    np.testing.assert_allclose(inner(half.pixels), inner(means), rtol=0.025)


@pytest.mark.parametrize("margin", [2, 8])
def test_the_picture_is_what_the_camera_shows(margin, tmp_path):
    """The frame of pixels that DefaultCrop leaves out is left out, at every size."""
    path = write_dng(tmp_path / "a.dng", scene(), margin=margin)
    info = read_photo_info(path)

    assert (info.width, info.height) == (96, 64)
    np.testing.assert_allclose(inner(read(path).pixels), inner(scene()), rtol=0.01, atol=1e-3)
    assert read(path, longest=20).pixels.shape == (13, 20, 3)


def test_a_raw_tells_lens_and_exposure(tmp_path):
    info = read_photo_info(write_dng(tmp_path / "a.dng", scene()))

    assert info.camera_body == "Maker Model X"
    assert info.exposure_ev == pytest.approx(np.log2(200 / 100 / 125 / 64))


def test_developing_costs_little_more_than_libraw_itself(tmp_path):
    """Processor time beside LibRaw alone, the better of three."""
    path = write_dng(tmp_path / "a.dng", scene(1000, 1500))

    def least(work):
        spent = []
        for _ in range(3):
            start = time.process_time()
            work()
            spent.append(time.process_time() - start)
        return min(spent)

    def alone():
        with rawpy.imread(str(path)) as raw:
            raw.postprocess(output_bps=16, gamma=(1, 1), no_auto_bright=True)

    assert least(lambda: read(path)) < 2 * least(alone)


def test_a_broken_raw_is_one_sentence(tmp_path):
    path = write_dng(tmp_path / "a.dng", scene())
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(InputError, match=r"a\.dng: the photo is .*damaged"):
        read(path)


# --- HEIC and AVIF


def picture():
    return np.round(srgb_from_linear(scene()) * 255).astype(np.uint8)


def saved_heic(path, pixels, **options):
    bits = ";16" if pixels.dtype == np.uint16 else ""
    height, width = pixels.shape[:2]
    image = pillow_heif.from_bytes(f"RGB{bits}", (width, height), pixels.tobytes())
    image.save(path, quality=98, chroma=444, **options)
    return path


def test_a_heic_is_upright_and_tells_its_lens(tmp_path):
    """The file's own turn, which the writer makes of EXIF's number, is applied, and once."""
    exif = Image.Exif()
    exif.update({271: "Apple", 272: "Phone", 274: 6})
    exif.get_ifd(0x8769).update({0xA405: 26})
    path = saved_heic(tmp_path / "a.heic", picture(), exif=exif.tobytes())
    info, photo = read_photo_info(path), read(path)

    assert (info.width, info.height, info.camera_body) == (64, 96, "Apple Phone")
    assert info.orientation == 1
    assert info.focal_px == pytest.approx(26 / np.hypot(36, 24) * np.hypot(96, 64))
    assert photo.encoding == "srgb"
    assert np.abs(photo.pixels.astype(int) - np.rot90(picture(), -1)).max() <= 4


def test_a_heic_with_a_profile_or_ten_bits(tmp_path):
    profile = imagecodecs.cms_profile("adobergb")
    wide = read(saved_heic(tmp_path / "a.heic", picture(), icc_profile=profile))
    ten = (srgb_from_linear(scene()) * 65535).astype(np.uint16)
    deep = read(saved_heic(tmp_path / "b.heic", ten))

    assert wide.encoding == deep.encoding == "linear"
    assert np.abs(inner(wide.pixels) - inner(scene())).max() > 0.02
    np.testing.assert_allclose(inner(deep.pixels), inner(scene()), rtol=0.02, atol=2e-3)


def test_a_heic_without_its_reader_names_the_command(tmp_path, monkeypatch):
    path = saved_heic(tmp_path / "a.heic", picture())
    load = builtins.__import__

    def without(name, *rest):
        if name == "pillow_heif":
            raise ImportError(name)
        return load(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r"a\.heic: .*pip install pillow-heif"):
        read_photo_info(path)


def test_an_avif_is_upright(tmp_path):
    exif = Image.Exif()
    exif[274] = 6
    Image.fromarray(picture()).save(tmp_path / "a.avif", quality=100, exif=exif.tobytes())
    photo = read(tmp_path / "a.avif")

    assert (photo.width, photo.height) == (64, 96)
    assert np.abs(photo.pixels.astype(int) - np.rot90(picture(), -1)).max() <= 4


@pytest.mark.parametrize(("primaries", "scale"), [(1, 1.0), (12, 1.0)])
def test_an_avif_of_ten_bits(primaries, scale, tmp_path):
    """Ten bits fill the range; Display P3 named by its number is converted (gray stays gray, red
    becomes redder than sRGB's).
    """
    gray = np.full((32, 48, 3), 512, np.uint16)
    gray[:, 24:] = (1023, 0, 0)
    data = imagecodecs.avif_encode(gray, bitspersample=10, level=100, primaries=primaries,
                                   transfer=13)  # fmt: skip
    (tmp_path / "a.avif").write_bytes(data)
    pixels = read(tmp_path / "a.avif").pixels

    np.testing.assert_allclose(pixels[16, 6], linear_from_srgb(512 / 1023), rtol=0.01)
    red = pixels[16, 40]
    assert (red[0] > 1.15 and red[1] < -0.02) == (primaries == 12)


def test_a_picture_for_brighter_screens_is_refused(tmp_path):
    gray = np.full((32, 48, 3), 512, np.uint16)
    data = imagecodecs.avif_encode(gray, bitspersample=10, level=100, primaries=9, transfer=16)
    (tmp_path / "a.avif").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.avif: .*HDR .*PQ"):
        read_photo_info(tmp_path / "a.avif")


# --- OpenEXR


def saved_exr(path, channels, **header):
    told = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(told, channels).write(str(path))
    return path


@pytest.mark.parametrize(("kind", "atol"), [(np.float16, 5e-4), (np.float32, 0)])
def test_an_exr_is_linear(kind, atol, tmp_path):
    """Values above 1 and below 0 stay; exposure and focal length come from its attributes."""
    light = (scene() * 3 - 0.4).astype(np.float32)
    path = saved_exr(
        tmp_path / "a.exr", {"RGB": light.astype(kind)},
        expTime=0.01, aperture=8.0, isoSpeed=100.0, nominalFocalLength=50.0,
        sensorPhotositePitch=4.0, cameraMake="Maker", cameraModel="X",
    )  # fmt: skip
    info = read_photo_info(path)

    np.testing.assert_allclose(read(path).pixels, light, rtol=1e-3, atol=atol)
    assert info.focal_px == pytest.approx(50 / 0.004)
    assert info.exposure_ev == pytest.approx(np.log2(0.01 / 64), abs=1e-4)
    assert info.camera_body == "Maker X"


def test_an_exr_of_other_primaries_gray_or_with_alpha(tmp_path):
    """Adobe's green is converted; gray becomes three channels; alpha 0 is never used, and colors
    are divided by alpha.
    """
    adobe = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329)
    green = np.zeros((8, 12, 3), np.float32) + np.float32((0, 0.5, 0))
    wide = read(saved_exr(tmp_path / "a.exr", {"RGB": green}, chromaticities=adobe)).pixels[4, 4]
    assert wide[0] < -0.1 and wide.sum() < 0.5

    gray = read(saved_exr(tmp_path / "b.exr", {"Y": np.full((8, 12), 0.25, np.float32)}))
    np.testing.assert_allclose(gray.pixels, 0.25)

    alpha = np.ones((8, 12, 1), np.float32)
    alpha[0], alpha[1] = 0, 0.5
    cut = read(saved_exr(tmp_path / "c.exr", {"RGBA": np.dstack([alpha * 0.4] * 3 + [alpha])}))
    assert (cut.mask[0] == 0).all() and cut.mask[1:].all()
    np.testing.assert_allclose(cut.pixels[1:], 0.4, rtol=1e-6)


def test_an_exr_of_a_smaller_window_is_placed(tmp_path):
    """What the data window leaves out of the display window is never used."""
    window = (np.array([0, 0], np.int32), np.array([19, 9], np.int32))
    inside = (np.array([4, 1], np.int32), np.array([15, 8], np.int32))
    path = saved_exr(tmp_path / "a.exr", {"RGB": np.full((8, 12, 3), 0.5, np.float32)},
                     displayWindow=window, dataWindow=inside)  # fmt: skip
    photo = read(path)

    assert (photo.width, photo.height) == (20, 10)
    expected = np.zeros((10, 20), bool)
    expected[1:9, 4:16] = True
    np.testing.assert_array_equal(photo.mask > 0, expected)
    np.testing.assert_array_equal(photo.pixels[expected], 0.5)


# --- floating-point TIFF


def test_a_float_tiff_says_which_light_is_assumed_and_a_setting_changes_it(tmp_path):
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.full((8, 12, 3), 0.5, np.float32), photometric="rgb")

    assert any("linear light" in note and "float_light" in note
               for note in read_photo_info(path).notes)  # fmt: skip
    np.testing.assert_allclose(read(path).pixels, 0.5)
    encoded = read(path, float_light="srgb")
    np.testing.assert_allclose(encoded.pixels, linear_from_srgb(0.5), rtol=1e-6)


# --- RAW beside JPEG


def test_of_a_shot_one_file_is_the_photo(tmp_path):
    """The RAW unless the JPEG is preferred; photos of one kind stay; the note names what is left
    and the setting.
    """
    names = ["1.CR2", "1.jpg", "2.jpg", "3.nef", "4.dng", "4.JPG"]
    paths = {name: tmp_path / name for name in names}
    raw = one_per_shot(paths, RAW_SUFFIXES, "raw")
    jpeg = one_per_shot(paths, RAW_SUFFIXES, "jpeg")

    assert list(raw.paths) == ["1.CR2", "2.jpg", "3.nef", "4.dng"]
    assert list(jpeg.paths) == ["1.jpg", "2.jpg", "3.nef", "4.JPG"]
    assert "1.jpg, 4.JPG" in raw.notes[0] and 'pair = "jpeg"' in raw.notes[0]
    assert one_per_shot({"a.jpg": tmp_path / "a.jpg"}, RAW_SUFFIXES, "raw").notes == ()


def test_a_raw_by_another_name_is_known_by_its_content(tmp_path):
    """A DNG that somebody called .tif is developed, not read as a gray picture."""
    path = write_dng(tmp_path / "a.tif", scene())

    assert read(path).pixels.shape == (64, 96, 3)
    assert io.BytesIO(path.read_bytes()).read(4) == b"II*\0"


def test_the_preview_of_a_raw_is_its_thumbnail(tmp_path):
    """Upright; a RAW without one has none here."""
    path = write_dng(tmp_path / "a.dng", scene(480, 640), orientation=6)
    assert read_thumbnail(path, read_photo_info(path), 240) is None

    small = np.round(srgb_from_linear(scene(480, 640)) * 255).astype(np.uint8)
    jpeg = io.BytesIO()
    Image.fromarray(small).save(jpeg, "JPEG", quality=95, subsampling=0)
    write_dng(path, scene(480, 640), orientation=6, preview=jpeg.getvalue())
    thumb = read_thumbnail(path, read_photo_info(path), 240)

    assert (thumb.width, thumb.height, thumb.encoding) == (180, 240, "srgb")
    whole = read(path, longest=240).srgb8()
    assert np.abs(thumb.pixels.astype(int) - whole).mean() < 3
