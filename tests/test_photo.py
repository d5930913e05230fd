"""Photos as values: the sRGB curve, encodings, reduction, and picks."""

import cv2
import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.photo import (
    LINEAR_OF_SRGB8,
    Correspondences,
    Photo,
    PhotoInfo,
    linear_from_srgb,
    srgb_from_linear,
)


def photo(pixels, mask=None):
    height, width = pixels.shape[:2]
    return Photo(PhotoInfo("a.png", width, height), pixels, mask)


# --- the sRGB curve


def test_the_curve_meets_the_standard():
    """IEC 61966-2-1: black, white, the end of the straight part, and two known grays."""
    encoded = [0, 0.04045, 0.5, 188 / 255, 1]
    linear = [0, 0.04045 / 12.92, 0.21404114, 0.50288646, 1]
    np.testing.assert_allclose(linear_from_srgb(encoded), linear, rtol=2e-6)
    np.testing.assert_allclose(srgb_from_linear(linear), encoded, rtol=2e-6)


def test_the_curve_grows_without_a_jump():
    ramp = linear_from_srgb(np.linspace(0, 1, 100_001))
    steps = np.diff(ramp)
    assert (steps > 0).all()
    assert steps.max() < 2.3e-5  # the slope at white is 2.27


def test_eight_and_sixteen_bits_come_back_exactly():
    for top in (255, 65535):
        values = np.arange(top + 1)
        back = srgb_from_linear(linear_from_srgb(values / top)) * top
        np.testing.assert_array_equal(np.round(back).astype(int), values)


def test_encoding_clips_what_no_file_can_hold():
    np.testing.assert_allclose(srgb_from_linear([-0.5, 1.5]), [0, 1], atol=1e-7)


# --- encodings of a photo


def test_srgb_and_linear_photos_of_the_same_scene_agree():
    pixels = np.random.default_rng(0).integers(0, 256, (20, 30, 3)).astype(np.uint8)
    encoded, linear = photo(pixels), photo(linear_from_srgb(pixels / 255))
    assert (encoded.encoding, linear.encoding) == ("srgb", "linear")
    np.testing.assert_allclose(encoded.linear(), linear.linear(), atol=1e-6)
    np.testing.assert_allclose(encoded.gray(), linear.gray(), atol=0.6 / 255)
    np.testing.assert_array_equal(encoded.linear(), LINEAR_OF_SRGB8[pixels])


def test_gray_is_luma_from_black_to_white():
    pixels = np.array([[[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 255, 0]]], np.uint8)
    np.testing.assert_allclose(photo(pixels).gray(), [[0, 1, 0.299, 0.587]], atol=1 / 255)


def test_sizes_are_width_and_height():
    small = photo(np.zeros((20, 30, 3), np.uint8))
    assert (small.width, small.height) == (30, 20)


# --- reduction


def test_reduction_averages_areas_and_keeps_the_frame():
    """Half the size: each pixel the mean of four, its center between theirs."""
    pixels = np.zeros((4, 6, 3), np.float32)
    pixels[..., 0] = np.arange(6) + 0.5  # its own x
    pixels[..., 1] = np.arange(4)[:, None] + 0.5
    half = photo(pixels).resized(3, 2).pixels
    np.testing.assert_allclose(half[0, :, 0], [1, 3, 5])
    np.testing.assert_allclose(half[:, 0, 1], [1, 3])


def test_the_mask_follows_without_new_values_and_without_a_shift():
    """A forbidden strip stays where it is, to half a pixel of the reduced mask."""
    mask = np.full((90, 120), 255, np.uint8)
    mask[:, 40:80] = 0
    small = photo(np.zeros((90, 120, 3), np.uint8), mask).resized(24, 18).mask
    assert set(np.unique(small)) == {0, 255}
    np.testing.assert_array_equal(np.flatnonzero(small[5] == 0), np.arange(8, 16))
    odd = photo(np.zeros((90, 120, 3), np.uint8), mask).resized(50, 38).mask
    edges = np.flatnonzero(np.diff(odd[5].astype(int))) + 1
    np.testing.assert_allclose(edges * 120 / 50, [40, 80], atol=1.2)


def test_photo_and_camera_are_reduced_to_the_same_size_and_never_enlarged():
    """By the longer side, upright and lying; what is small enough is the very same photo."""
    for width, height in ((120, 90), (90, 120), (301, 7)):
        whole = photo(np.zeros((height, width, 3), np.uint8))
        pose = Pose.identity()
        camera = Camera(Intrinsics(width, height, 99, 99, width / 2, height / 2), pose)
        small, view = whole.reduced(50), camera.reduced(50)
        assert max(small.width, small.height) == 50
        assert (small.width, small.height) == (view.width, view.height)
        assert whole.reduced(400) is whole
        assert camera.reduced(400).intrinsics == camera.intrinsics


# --- picks


def test_picks_pair_up_and_are_named_by_number():
    picks = Correspondences(np.zeros((3, 2)), np.zeros((3, 3)))
    assert len(picks) == 3
    assert picks.names == ("1", "2", "3")
    with pytest.raises(ValueError, match="2 pixels and 3 points"):
        Correspondences(np.zeros((2, 2)), np.zeros((3, 3)))


def test_opencv_reads_what_a_photo_holds():
    """Rows first, RGB: a red pixel in the third column of the first row."""
    pixels = np.zeros((2, 4, 3), np.uint8)
    pixels[0, 2] = (255, 0, 0)
    hsv = cv2.cvtColor(photo(pixels).pixels, cv2.COLOR_RGB2HSV)
    np.testing.assert_array_equal(hsv[0, 2], [0, 255, 255])
