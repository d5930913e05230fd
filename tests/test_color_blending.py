"""Ways to make one color of many, on samples whose answer is known on paper."""

from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest
from color_scenes import camera, picture, plane
from photo_sets import photo_set

from texproj.color.blending.bands import restored
from texproj.color.blending.combine import USUAL_PREFERENCE, blend
from texproj.color.blending.preference import decided
from texproj.color.sampling.light_around import AROUND_ONE, light_around, soft_light
from texproj.color.sampling.prepare import photo_view
from texproj.color.sampling.sample import Samples
from texproj.color.sampling.store import SampleStore, Stack
from texproj.color.vertices import color_vertices
from texproj.options import ColorOptions, RenderOptions
from texproj.render import open_renderer
from texproj.resources.scratch import Scratch

MODES = ("multi-band", "robust", "mean", "best")
GREY = 0.25


def stack(values, weights=None, around=None) -> Stack:
    """Grey samples (p, n) as what p photos say about n points."""
    light = np.asarray(values, np.float32)
    weight = np.ones_like(light) if weights is None else np.asarray(weights, np.float32)
    rgb = np.repeat(light[:, None], 3, axis=1) * (weight > 0)[:, None]
    around = np.ones_like(light) if around is None else np.asarray(around, np.float32)
    return Stack(np.arange(len(light)), rgb, weight, around)


def blended(samples: Stack, **options):
    gain = np.ones((len(samples.photos), 3), np.float32)
    return blend(samples, gain, ColorOptions(**options))


@pytest.mark.parametrize("preference", [0.0, 0.35, 2.0])
@pytest.mark.parametrize("mode", MODES)
def test_photos_that_agree_give_what_they_show(mode, preference):
    """Equal samples come out as they are, whatever their weights and how these are preferred;
    unseen points stay 0, and photos that do not see a point count for nothing.
    """
    weights = [[1, 0.2, 0], [0.5, 0.9, 0], [0.1, 0, 0]]
    samples = stack(np.full((3, 3), GREY), weights)
    result = blended(samples, blend=mode, preference=preference)
    assert np.abs(result.rgb[:2] - GREY).max() < 1e-6
    assert not result.rgb[2].any() and result.weight[2] == 0
    assert result.photo_count.tolist() == [3, 2, 0]
    assert result.share.sum() == pytest.approx(2)


def test_the_mean_is_weighted():
    """The mean is that of Callieri et al.: the sum of weight times color over the weights."""
    result = blended(stack([[0.2], [0.5]], [[0.25], [0.75]]), blend="mean")
    assert result.rgb[0] == pytest.approx([0.25 * 0.2 + 0.75 * 0.5] * 3)


@pytest.mark.parametrize(("mode", "most"), [("multi-band", 0.02), ("robust", 0.02), ("best", 1e-6)])
def test_something_else_in_one_photo_leaves_little(mode, most):
    """A sample far off counts little even with the largest weight; the mean takes it."""
    samples = stack([[GREY], [GREY], [GREY], [0.9]], [[0.6], [0.5], [0.4], [1]])
    assert 0 <= blended(samples, blend=mode).rgb[0, 0] - GREY < most
    assert blended(samples, blend="mean").rgb[0, 0] > GREY + 0.2


@pytest.mark.parametrize("mode", ["multi-band", "robust", "best"])
def test_something_of_another_tint_counts_little(mode):
    """A sample of equal luminance and another color is left out too."""
    samples = stack([[GREY]] * 4, [[0.6], [0.5], [0.4], [1]])
    samples.rgb[3, :, 0] = 0.9, (GREY - 0.2126 * 0.9) / 0.7152 * 0.9, 0.2
    assert np.abs(blended(samples, blend=mode).rgb[0] - GREY).max() < 0.03
    assert np.abs(blended(samples, blend="mean").rgb[0] - GREY).max() > 0.2


def test_the_best_is_one_photo():
    """The largest weight among what agrees decides alone."""
    samples = stack([[0.250], [0.254], [0.258]], [[0.3], [0.9], [0.6]])
    result = blended(samples, blend="best")
    assert result.rgb[0, 0] == pytest.approx(0.254)
    assert result.share == pytest.approx([0, 1, 0])


def test_preference_moves_to_the_heavier():
    """The larger the preference, the nearer to the sample of larger weight, between both."""
    samples = stack([[0.25], [0.27]], [[0.2], [1]])
    colors = [blended(samples, preference=p).rgb[0, 0] for p in (0.0, 0.5, 1.0, 4.0)]
    assert np.all(np.diff(colors) > 0)
    assert colors[0] == pytest.approx(0.26, abs=1e-3)
    assert colors[-1] == pytest.approx(0.27, abs=1e-3)


def test_detail_that_is_apart_gets_its_strength_back():
    """Three photos with a step a texel apart: the averaged detail, weaker than in any photo, comes
    nearer to their root mean square, never over it, and keeps its sign.
    """
    detail = np.array([[0.1, -0.1], [0.1, -0.02], [0.05, -0.1], [0.1, -0.1]], np.float32)
    trust = np.full((4, 2), 0.25, np.float32)
    mean, power = detail.mean(axis=0), np.sqrt(np.square(detail).mean(axis=0))
    base = np.full((2, 3), GREY, np.float32)
    gained = (np.sqrt(restored(base, trust, detail)[:, 1]) - 0.5) * np.sign(mean)
    assert (gained > 0).all()
    assert (np.abs(mean) + gained < power + 1e-6).all()


def test_noise_is_not_strengthened():
    """Detail that is as often up as down gets nothing back, and stays as small as averaging made
    it, to a third.
    """
    rng = np.random.default_rng(0)
    detail = rng.normal(0, 0.03, (8, 4000)).astype(np.float32)
    trust = np.full(detail.shape, 1 / 8, np.float32)
    light = 0.5 + detail.mean(axis=0)
    base = np.repeat(np.square(light)[:, None], 3, axis=1)
    out = np.sqrt(restored(base, trust, detail)[:, 0])
    gain = out.std() / light.std()
    assert 1 < gain < 1.3


def test_one_photo_keeps_its_detail():
    """Where a single photo sees the point nothing is changed."""
    samples = stack([[0.3, 0.2]], around=[[0.5, 2.0]])
    assert blended(samples).rgb[:, 0] == pytest.approx([0.3, 0.2])


def test_light_around_is_that_of_the_photo():
    """On a plain photo the light around is the point's own; near an edge it lies between."""
    view = camera((0, 0, 3.0))
    photo = picture(view, lambda x, y: np.where((x < 0)[..., None], 0.1, 0.4) * np.ones(3))
    with open_renderer(RenderOptions(renderer="cpu")) as cpu, cpu.load(plane()) as scene:
        seen = photo_view(photo, view, scene, ColorOptions())
    assert len(seen.soft) == len(seen.levels)
    edge = int(np.argmax(seen.levels[0][90, :, 1] > 15000))
    xy = np.zeros((1, 256, 2), np.float32)
    xy[0, :3] = (20, 90), (edge, 90), (edge - 1, 90)
    rgb = seen.levels[0][90, xy[0, :, 0].astype(int)][None]
    ratio = light_around(seen, rgb, xy, None)[:3] / AROUND_ONE
    assert ratio[0] == pytest.approx(1, abs=1e-3)
    assert 0.5 < ratio[1] < 0.95  # brighter than around; the dark side alone would make it 0.5
    assert 1.05 < ratio[2] < 2


def test_soft_light_has_one_image_per_level():
    """The last levels share the last image; a plain pyramid's light is the root of its own."""
    levels = tuple(np.full((s, s, 3), 15000, np.uint16) for s in (64, 32, 16, 8))
    soft = soft_light(levels)
    assert [image.shape[0] for image in soft] == [16, 8, 8, 8]
    assert all(np.abs(image - np.sqrt(15000)).max() < 0.01 for image in soft)


def test_light_around_comes_back_from_disk():
    """Samples with and without it are read as they were written, 0 where unseen."""
    seen = np.array([True, False, True])
    packed = np.array([[60000, 30000, 0, 65535], [6000, 6000, 6000, 1]], np.uint16)
    for around in (np.array([16384, 8192], np.uint16), None):
        scratch = Scratch()
        store = SampleStore([3], scratch)
        store.add(4, 0, Samples(seen, packed, around))
        read = store.read(0)
        scratch.close()
        assert read.photos.tolist() == [4]
        assert read.rgb[0, :, 0] == pytest.approx([1, 0.5, 0])
        if around is None:
            assert read.around is None
        else:
            assert read.around.tolist() == [[1, 0, 0.5]]


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_colors_a_plane(mode):
    """Smooth colors seen by several photos come out alike in all modes."""
    views = ((0.3, 0.2, 3.0), (-0.9, 0.4, 2.8), (0.8, -0.7, 2.6))
    cameras, mesh = [camera(c) for c in views], plane()
    photos = [picture(c) for c in cameras]
    with open_renderer(RenderOptions(renderer="cpu")) as cpu:
        result = color_vertices(mesh, photo_set(cameras, photos), cpu, ColorOptions(blend=mode))
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    waves = [np.sin(5 * x + 1), np.cos(4 * y - 0.5), np.sin(3 * (x + y))]
    truth = np.stack([0.4 + 0.25 * wave for wave in waves], axis=1)
    sure = result.photo_count > 1
    assert sure.mean() > 0.8
    assert np.abs(result.rgb - truth)[sure].max() < 0.006


def stored(noise, weights, scratch, points=6000):
    """Samples of a random pattern by photos of such noise and weights, in one chunk."""
    rng, count = np.random.default_rng(3), len(noise)
    truth = 0.25 * (1 + 0.4 * rng.standard_normal(points)).clip(0.1, 2)
    store = SampleStore([points], scratch)
    for number in range(count):
        light = (truth * (1 + noise[number] * rng.standard_normal(points))).clip(0, 1)
        packed = np.repeat(light[:, None], 4, axis=1) * 65535
        packed[:, 3] = weights[number] * 65535
        around = np.full(points, AROUND_ONE, np.uint16)
        store.add(number, 0, Samples(np.ones(points, bool), packed.astype(np.uint16), around))
    return store, SimpleNamespace(sizes=[points])


@pytest.mark.parametrize(
    ("noise", "wanted"), [((0.02, 0.3, 0.3, 0.3, 0.3), 0.85), ((0.15,) * 5, 0.1)]
)
def test_the_photos_decide_how_much_the_best_is_preferred(noise, wanted):
    """Where photos of little weight are bad, much; where all are as good, hardly. What is set by
    hand stays; of too few points nothing follows.
    """
    with closing(Scratch()) as scratch:
        store, points = stored(noise, (1, 0.1, 0.1, 0.1, 0.1), scratch)
        ask = (store, points, np.ones((5, 3)), [None] * 5)
        assert decided(*ask, ColorOptions()).preference == wanted
        assert decided(*ask, ColorOptions(preference=0.7)).preference == 0.7
        few, points = stored(noise, (1, 0.1, 0.1, 0.1, 0.1), scratch, points=50)
        ask = (few, points, np.ones((5, 3)), [None] * 5)
        assert decided(*ask, ColorOptions()).preference == USUAL_PREFERENCE
