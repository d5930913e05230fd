"""What photos count for: each factor, where it is known on paper."""

import cv2
import numpy as np
import pytest
from color_scenes import camera, picture, plane
from photo_sets import photo_set

from texproj.camera import Camera
from texproj.color.balance.focus import median_of_others, node_positions, upper_medians
from texproj.color.balance.shared_points import PointObserver
from texproj.color.balance.sharpness import SIDE, energies
from texproj.color.blending.combine import blend
from texproj.color.blending.highlights import highlight_factor
from texproj.color.factors import Inspection, photo_factors
from texproj.color.points.pixels import PixelPoints
from texproj.color.sampling.gather import project_views
from texproj.color.sampling.prepare import photo_view
from texproj.color.sampling.store import Stack
from texproj.color.weights.picture import FLOOR, exposure_factor, mask_factor, silhouette_factor
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import Photo, PhotoInfo
from texproj.render import open_renderer
from texproj.resources.scratch import Scratch

VIEWS = ((0.3, 0.2, 3.0), (-0.7, 0.4, 2.8), (0.6, -0.5, 2.9), (-0.2, -0.6, 3.1), (0.1, 0.7, 3.0))
SIZE = (240, 180)


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


@pytest.fixture(scope="module")
def scene(renderer):
    with renderer.load(plane()) as scene:
        yield scene


def mottled(x, y) -> np.ndarray:
    """Gray around 0.4 with waves of 3 to 48 pixels of the photos, as strong in each octave, and
    plain spots between, as real surfaces have."""
    rng = np.random.default_rng(3)
    value = np.zeros(x.shape)
    for k in range(48):
        angle, length, phase = rng.uniform(0, np.pi), 0.04 * 2 ** (k / 12), rng.uniform(0, 6)
        value += np.sin((x * np.cos(angle) + y * np.sin(angle)) * 2 * np.pi / length + phase)
    rough = np.clip(1.5 * np.sin(14 * x) * np.cos(13 * y) + 0.5, 0, 1)
    return np.clip(0.4 + 0.03 * value * rough, 0.05, 0.9)[..., None] * np.ones(3)


def views() -> list[Camera]:
    return [camera(center) for center in VIEWS]


def photos(spoil=None, number: int = 1) -> list[Photo]:
    """The mottled plane from all sides; one photo is spoiled by a function on its pixels."""
    made = [picture(view, mottled) for view in views()]
    if spoil:
        made[number] = Photo(made[number].info, spoil(made[number].pixels).astype(np.float32))
    return made


def inspected(scene, shots, options=None, number: int = 1):
    """Factors of a photo as images in its frame."""
    options = options or ColorOptions()
    cameras, scratch = views(), Scratch()
    mesh = plane()
    spacing = np.full(len(mesh.faces), 3.0 / 220)
    points = PixelPoints.of(mesh, scene, cameras, spacing)
    shown = photo_set(cameras, shots).rendered(scene, scratch)
    found, failed = photo_factors(Inspection(points, shown, options, scratch), {number: [number]})
    scratch.close()
    assert [int(one.name) for one in failed] == [k for k, shot in enumerate(shots) if shot is None]
    found = found[number]
    return {name: points.image(number, values) for name, values in found.items()}


def soft(sigma: float):
    return lambda pixels: cv2.GaussianBlur(pixels, (0, 0), sigma)


def test_detail_of_a_wave_is_half_its_amplitude_squared():
    """A wave of 4 points along one axis has that energy in the finest band, exactly."""
    x = np.arange(SIDE)
    patch = np.broadcast_to(1 + 0.1 * np.sin(2 * np.pi * (x + 0.5) / 4), (1, SIDE, SIDE))

    found = energies(patch.astype(np.float32))[0]

    np.testing.assert_allclose(found[0, 0], 0.1**2 / 2, rtol=1e-4)


def test_even_shading_is_no_detail():
    """A slope of brightness has no energy in any band."""
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    patch = (1 + 0.01 * x - 0.02 * y)[None].astype(np.float32)

    assert energies(patch)[0].max() < 1e-9


def test_median_of_others_leaves_each_out():
    """By hand: groups of 4, 2 and 1, mixed up."""
    values = np.array([5.0, 1.0, 7.0, 2.0, 9.0, 4.0, 3.0])
    group = np.array([0, 0, 1, 0, 1, 0, 2])

    median, count = median_of_others(values, group)

    np.testing.assert_array_equal(median, [2, 4, 9, 4, 7, 2, np.nan])
    np.testing.assert_array_equal(count, [3, 3, 1, 3, 1, 3, 0])


def test_upper_medians_hold_what_they_promise():
    """For 97.5 % of clouds of values the limit is above the true median; and not far above: 1.96
    deviations of a median of the 60 to 200 values that count."""
    rng = np.random.default_rng(1)
    nodes = node_positions(640, 480)[2:4, 3:5]
    above, width = [], []
    for _ in range(500):
        limits = upper_medians(rng.random((200, 2)), rng.standard_normal(200), nodes)
        above += list(limits > 0)
        width += list(limits)

    assert 0.95 < np.mean(above) < 0.995
    assert 1.96 * 1.25 / 200**0.5 < np.mean(width) < 1.96 * 1.25 / 60**0.5


def test_a_blurred_photo_is_found(scene):
    """Of five photos the blurred one is distrusted where it shows the plane, and no other one."""
    shots = photos(soft(1.5))

    assert np.nanmax(inspected(scene, shots)["focus"]) < 0.4
    for number in (0, 2, 3, 4):
        assert np.nanmin(inspected(scene, shots, number=number)["focus"]) == 1


def test_a_photo_blurred_on_one_side(scene):
    """Only the blurred side is distrusted."""

    def left(pixels):
        out = pixels.copy()
        out[:, : SIZE[0] // 2] = soft(1.5)(pixels)[:, : SIZE[0] // 2]
        return out

    focus = inspected(scene, photos(left))["focus"]

    assert np.nanmean(focus[60:120, 50:90]) < 0.5
    assert np.nanmean(focus[60:120, 160:200]) > 0.9


@pytest.mark.parametrize(
    "spoil",
    [
        lambda pixels: pixels * 0.25,
        lambda pixels: pixels * (0.9, 0.6, 0.4),
        lambda pixels: 0.5 * pixels + 0.2,
        lambda p: np.clip(p + np.random.default_rng(0).normal(0, 0.02, p.shape), 0, 1),
    ],
    ids=["dark", "yellow", "haze", "noise"],
)
def test_what_is_not_blur(scene, spoil):
    """Exposure, color, haze and noise are not taken for blur, of whichever photo."""
    shots = photos(spoil)

    assert np.nanmin(inspected(scene, shots)["focus"]) == 1
    assert np.nanmin(inspected(scene, shots, number=0)["focus"]) == 1


def test_blur_can_be_overlooked(scene):
    """With the power 0 nothing is measured and nothing is distrusted."""
    focus = inspected(scene, photos(soft(1.5)), ColorOptions(focus_power=0))["focus"]

    assert np.nanmin(focus) == 1


def test_focus_power_is_a_power(scene):
    """Twice the power, the square of the trust, down to the floor."""
    shots = photos(soft(0.8))
    once, twice = (
        inspected(scene, shots, ColorOptions(focus_power=power))["focus"] for power in (1, 2)
    )
    middle = (slice(60, 120), slice(80, 160))

    assert np.nanmax(once[middle]) < 0.9
    np.testing.assert_allclose(twice[middle], once[middle] ** 2, rtol=0.05, atol=float(FLOOR))


def test_two_photos_cannot_judge_each_other(scene):
    """Without two witnesses nobody is called blurred."""
    shots = photos(soft(1.5))
    shots[2:] = [None] * 3

    assert np.nanmin(inspected(scene, shots)["focus"]) == 1


def test_somebody_in_front_is_inconsistent(scene):
    """Where one photo shows something else its consistency is low, elsewhere high."""

    def blocked(pixels):
        out = pixels.copy()
        out[70:110, 100:140] = (0.9, 0.05, 0.05)
        return out

    consistency = inspected(scene, photos(blocked))["consistency"]

    assert np.nanmax(consistency[72:108, 102:138]) < 0.2
    assert np.nanmedian(consistency[20:60, 100:140]) > 0.8


def colors(*rgb) -> np.ndarray:
    """(p, 3, 1) linear light of one point in p photos."""
    return np.array(rgb, np.float32)[:, :, None]


def test_a_highlight_counts_less():
    """White light on a red surface in one of four photos: by the formula, and only there."""
    red, glint = (0.4, 0.1, 0.1), (0.7, 0.4, 0.4)
    weight = np.ones((4, 1), np.float32)

    factor = highlight_factor(colors(red, red, glint, red), weight, 1.0)[:, 0]

    luminance = np.array([0.2126, 0.7152, 0.0722])
    over = (np.sqrt(luminance @ glint) - np.sqrt(luminance @ red)) / 0.1
    np.testing.assert_allclose(factor, [1, 1, 1 / (1 + over**2), 1], rtol=1e-3)


def test_what_is_no_highlight():
    """Red that is brighter, a shadow, a photo that is alone with one other, strength 0: all 1."""
    red, bright, dark = (0.4, 0.1, 0.1), (0.8, 0.2, 0.2), (0.1, 0.03, 0.03)
    white, ones = (0.9, 0.9, 0.9), np.ones((4, 1), np.float32)
    two = np.array([[1], [1], [0], [0]], np.float32)

    assert highlight_factor(colors(red, red, bright, red), ones, 1.0).min() == 1
    assert highlight_factor(colors(red, red, dark, red), ones, 1.0).min() == 1
    assert highlight_factor(colors(red, white, red, red), two, 1.0).min() == 1
    assert highlight_factor(colors(red, white, red, red), ones, 0.0).min() == 1


def test_blending_leaves_a_highlight_out():
    """The plain mean with a strong factor is the surface's color to 2 %; without, far off."""
    red, glint = np.array([0.4, 0.1, 0.1]), (0.7, 0.4, 0.4)
    stack = Stack(np.arange(4), colors(red, red, glint, red), np.ones((4, 1), np.float32))
    found = [
        blend(stack, np.ones((4, 3), np.float32), ColorOptions(blend="mean", highlight=strength))
        for strength in (0, 50)
    ]

    np.testing.assert_allclose(found[0].rgb[0], red + 0.075, rtol=1e-4)
    np.testing.assert_allclose(found[1].rgb[0], red, atol=0.002)


def test_angle_and_density_are_those_of_the_plane(scene):
    """The factors of the surface are what the angles and distances on paper say."""
    found = inspected(scene, photos())
    view = views()[1]
    origin, ray = view.rays([[120.5, 90.5]])
    cosine = -ray[0, 2]
    depth = origin[0, 2] / cosine * (ray[0] @ view.pose.R[2])
    pixels = 220 * (3.0 / 220) / depth

    assert abs(found["angle"][90, 120] - cosine) < 0.02
    assert abs(found["density"][90, 120] - min(pixels**2, 1)) < 0.03


def test_all_factors_have_the_frame_of_the_photo(scene):
    """Every image is of the photo's size and tells of the same pixels."""
    found = inspected(scene, photos())
    shown = np.isfinite(found["weight"])

    assert list(found) == [
        "angle", "density", "border", "silhouette", "exposure", "focus", "highlight",
        "consistency", "weight",
    ]  # fmt: skip
    for image in found.values():
        assert image.shape == SIZE[::-1]
        np.testing.assert_array_equal(np.isfinite(image), shown)
        assert 0 <= np.nanmin(image) <= np.nanmax(image) <= 1


def test_weight_is_the_product(scene):
    """What coloring uses is the product of the factors, by 16 bits and nearest lookups."""
    found = inspected(scene, photos())
    product = np.prod([v for k, v in found.items() if k != "weight"], axis=0)
    inside = (slice(20, 160), slice(20, 220))
    both = np.isfinite(product[inside])

    error = np.abs(product[inside] - found["weight"][inside])[both]
    assert np.quantile(error, 0.95) < 0.03


def test_pixels_are_where_they_look(scene):
    """The points that pixels show project back to their centers."""
    mesh, view = plane(), views()[2]
    points = PixelPoints.of(mesh, scene, [view], np.ones(len(mesh.faces)))
    row, column = np.nonzero(points.masks[0])

    xy, _ = view.project(points.chunk(0).xyz + points.owners.origin)

    assert len(row) > 10_000
    np.testing.assert_allclose(xy, np.stack([column, row], 1) + 0.5, atol=0.01)


def test_masks_grow():
    """A mask over the left half: 0 up to its edge and the growth, 1 past the ramp."""
    mask = np.full((100, 100), 255, np.uint8)
    mask[:, :50] = 0

    factor = mask_factor(mask, (100, 100), 10, 4)

    assert factor[50, 59] == 0
    assert 0 < factor[50, 61] < 1
    assert factor[50, 65] == 1


def test_exposure_has_two_ends():
    """White and black count as the options say, what lies between fully."""
    values = np.array([[0, 0.0015, 0.004, 0.5, 0.9, 0.99, 1.0]])
    small = np.round(np.dstack([values] * 3) * 60000).astype(np.uint16)

    factor = exposure_factor(small, 60000, 0.2, 0.3)[0]

    np.testing.assert_allclose(factor, [0.3, 0.3, 1, 1, 1, 0.2, 0.2], atol=0.01)


def test_silhouettes_can_be_switched_off():
    """A step in depth: FLOOR beside it, 1 past the ramp, and 1 everywhere without a ramp."""
    depth = np.ones((20, 40), np.float32)
    depth[:, 20:] = 2

    factor = silhouette_factor(depth, 100, 5)

    assert factor[10, 20] == FLOOR
    assert factor[10, 30] == 1
    assert silhouette_factor(depth, 100, 0).min() == 1


def test_the_survey_tells_sharpness_only_if_asked(scene):
    """Without the option no patch is looked up."""
    points = PixelPoints.of(plane(), scene, views()[:2], np.full(len(plane().faces), 0.013))
    shots = photos()
    for power in (0.0, 1.0):
        options, scratch = ColorOptions(focus_power=power), Scratch()
        made = [photo_view(shots[k], views()[k], scene, options) for k in range(2)]
        observer = PointObserver(points, 2, power > 0)
        project_views(points, made, observer, options, scratch)
        shared = observer.shared()
        scratch.close()

        assert (shared.detail is None) == (power == 0)


def test_a_photo_without_info_can_be_inspected(scene):
    """A photo that could not be loaded has no factors and harms no other."""
    shots = photos()
    shots[0] = None

    assert inspected(scene, shots)["weight"].shape == SIZE[::-1]
    assert PhotoInfo("a.jpg", 1, 1).exposure_ev is None


def test_a_blurred_photo_gives_its_light_but_no_detail():
    """Two sharp photos and a blurred one that alone has the right brightness around the points:
    the color keeps the mean of all around and takes the detail of the sharp ones.
    """
    soft = np.array([0.5, 0.5, 0.56])[:, None]  # square roots of the light around
    light = soft + np.array([0.1, 0.1, 0.0])[:, None]
    rgb = np.repeat(light[:, None] ** 2, 3, axis=1).astype(np.float32)
    around = (soft / light).astype(np.float32)
    trust = np.array([[1], [1], [0.01]], np.float32)
    stack = Stack(np.arange(3), rgb, trust.copy(), around, trust)

    found = blend(stack, np.ones((3, 3), np.float32), ColorOptions(robust_scale=10)).rgb[0, 0]

    assert abs(np.sqrt(found) - (soft.mean() + 0.1)) < 0.003
