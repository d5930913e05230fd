"""Orientation fields, patch matching and placement, on images whose answer is known."""

import cv2
import numpy as np
import pytest

from texproj.solve.matching import SearchImage, match_patches, match_windows, patch_grid
from texproj.solve.orientation import photo_field, render_field
from texproj.solve.placement import pivot_px, placements


def blobs(shape=(160, 200), seed=0, count=60) -> np.ndarray:
    """Dark and bright boxes on gray, in 0..1."""
    rng = np.random.default_rng(seed)
    image = np.full(shape, 0.5, np.float32)
    for _ in range(count):
        y, x = rng.integers(0, shape[0] - 10), rng.integers(0, shape[1] - 10)
        h, w = rng.integers(5, 25, 2)
        image[y : y + h, x : x + w] = rng.uniform(0.2, 0.9)
    return image


def edge(angle: float, size: int = 41) -> np.ndarray:
    """A straight edge through the middle whose gradient points at `angle`."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    return (1 / (1 + np.exp(-(x * np.cos(angle) + y * np.sin(angle))))).astype(np.float32)


def moved(image: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """The image warped by a 2 x 3 matrix in OpenCV's pixel coordinates."""
    size = image.shape[::-1]
    return cv2.warpAffine(image, matrix, size, flags=cv2.INTER_CUBIC, borderValue=0.5)


def shifted(image: np.ndarray, dx: float, dy: float) -> np.ndarray:
    return moved(image, np.float32([[1, 0, dx], [0, 1, dy]]))


@pytest.mark.parametrize("degrees", [0, 30, 75, 90, 140])
def test_field_doubles_the_gradient_angle(degrees):
    """An edge whose gradient points at angle a gives a field of phase 2a at that edge."""
    field = render_field([edge(np.radians(degrees))], np.ones((41, 41), bool))

    gap = np.angle(field[20, 20] * np.exp(-2j * np.radians(degrees)))

    assert abs(gap) < np.radians(1)


def test_field_ignores_sign_and_strength():
    """A negative of half the contrast has the same field where edges are strong."""
    image = blobs()
    negative = 0.75 - 0.5 * image
    everywhere = np.ones(image.shape, bool)

    a, b = render_field([image], everywhere), render_field([negative], everywhere)

    assert np.abs(a - b).max() < 1e-4
    assert np.abs(a).max() > 0.8


def test_photo_field_levels_light():
    """A photo at an eighth of the light keeps its field, up to the noise floor of the dark."""
    image = blobs()
    bright, dim = photo_field(image), photo_field(image / 8)

    alike = (bright * dim.conj()).real.sum() / np.sqrt(
        (np.abs(bright) ** 2).sum() * (np.abs(dim) ** 2).sum()
    )

    assert alike > 0.97


def test_invalid_pixels_say_nothing():
    """The field is zero where not valid, and no edge arises along that border."""
    valid = np.zeros((60, 60), bool)
    valid[20:40, 20:40] = True
    flat = np.where(valid, 0.8, 0.1).astype(np.float32)
    inner = cv2.erode(valid.astype(np.uint8), np.ones((11, 11), np.uint8)) > 0

    field = photo_field(flat, inner)

    assert not field[~inner].any()
    assert np.abs(field).max() < 0.05


def test_grid_keeps_filled_patches_with_valid_centers():
    """A patch is asked for only if enough of it, and its very center, is valid."""
    valid = np.zeros((100, 100), bool)
    valid[:, :50] = True
    valid[50, 10] = False

    grid = patch_grid(valid, 21, 1, filled=0.9)

    assert grid[:, 0].max() == 41  # 19 of 21 columns
    assert not ((grid == (10, 50)).all(axis=1)).any()


@pytest.mark.parametrize("shift", [(0.0, 0.0), (5.0, -3.0), (-4.4, 6.3)])
def test_patches_are_found_where_they_went(shift):
    """Patches of an image are found in its moved, inverted, noisy copy to a tenth of a pixel."""
    image = blobs()
    noise = np.random.default_rng(1).normal(0, 0.01, image.shape).astype(np.float32)
    photo = np.clip(1 - shifted(image, *shift) ** 1.3 + noise, 0, 1)
    centers = patch_grid(np.ones(image.shape, bool), 41, 20)

    found = match_patches(render_field([image], np.ones(image.shape, bool)), photo_field(photo),
                          centers, 41, 10)  # fmt: skip

    offset = found.target_px - found.source_px - shift
    assert len(found) > 0.8 * len(centers)
    assert 0 < np.median(np.abs(offset)) < 0.1
    assert found.strength.shape == (len(centers),)


def test_what_lies_outside_the_window_is_not_answered():
    """A shift beyond the search radius is not answered by the nearest rim of the window."""
    image = blobs()
    field = render_field([image], np.ones(image.shape, bool))
    centers = patch_grid(np.ones(image.shape, bool), 41, 20)

    found = match_patches(field, photo_field(shifted(image, 14, 0)), centers, 41, 8)

    assert (np.abs(found.target_px - found.source_px) < 8).all()
    assert found.score.max() < 0.8


def test_second_answers_come_second():
    """With two peaks asked, each patch has at most one of each rank, the first one better."""
    image = blobs()
    field = render_field([image], np.ones(image.shape, bool))
    found = match_patches(field, field, np.array([[100, 80], [60, 60]]), 41, 15, peaks=2)

    for patch in (0, 1):
        mine = found.patch == patch
        assert sorted(found.rank[mine]) == list(range(mine.sum()))
        assert np.argmax(found.score[mine]) == np.argmin(found.rank[mine])


def test_no_patches_no_matches():
    """An empty grid gives empty matches."""
    field = np.zeros((50, 50), np.complex64)

    assert len(match_patches(field, field, np.zeros((0, 2), int), 21, 5)) == 0


def test_placement_finds_roll_scale_and_shift():
    """A picture turned by 7 degrees, enlarged by 1.16 and shifted is placed so, to a pixel."""
    image = blobs((128, 160), seed=3, count=30)
    valid = np.ones(image.shape, bool)
    pivot = pivot_px(valid) - 0.5
    roll, scale, shift = np.radians(7), 1.16, (11, -6)
    c, s = scale * np.cos(roll), scale * np.sin(roll)
    linear = np.array([[c, -s], [s, c]])
    photo = moved(image, np.hstack([linear, (pivot - linear @ pivot + shift)[:, None]]))

    best = placements(render_field([image], valid), valid, photo_field(photo),
                      tuple(np.radians([-7, 0, 7])), (0.86, 1.0, 1.16))[0]  # fmt: skip

    assert best.roll_rad == pytest.approx(roll)
    assert best.scale == pytest.approx(scale)
    assert best.shift_px == pytest.approx(shift, abs=1)


def test_patches_from_elsewhere_are_found_as_those_of_a_template():
    """Cut out by hand and sought one set at a time; some of many windows, in any order."""
    template = photo_field(blobs())
    image = photo_field(shifted(blobs(), 3, -2))
    centers = patch_grid(np.ones(template.shape, bool), 15, 9)
    wanted = match_patches(template, image, centers, 15, 5)
    which = np.arange(len(centers))[::-1]

    def windows(some):
        corners = centers[some] - 7
        padded = np.pad(template, 7)
        return np.stack([padded[y + 7 : y + 22, x + 7 : x + 22] for x, y in corners])

    found = match_windows(windows, SearchImage.of(image, 15, 5).around(centers), which)

    assert len(found) > 50
    assert (which[found.patch][::-1] == wanted.patch).all()
    assert np.abs(found.target_px[::-1] - wanted.target_px).max() < 1e-3
