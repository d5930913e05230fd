"""Exposure, white balance and vignetting from the surface that photos share, on surveys and planes
whose light is known on paper.
"""

from dataclasses import replace

import numpy as np
import pytest
from color_scenes import SIZE, camera, pattern, picture, plane
from photo_sets import photo_set

from texproj.camera import Camera, Intrinsics, Pose
from texproj.color.balance import shared_points as shared_points_module
from texproj.color.balance.corrections import Correction, corrected, factors_at, grid_of, grids_of
from texproj.color.balance.photometry import solve_photometry
from texproj.color.balance.shared_points import PointObserver, SharedPoints, Shot
from texproj.color.balance.vignetting import lenses_of
from texproj.color.points.source import VertexPoints
from texproj.color.sampling.prepare import photo_view
from texproj.color.sampling.store import Stack
from texproj.color.vertices import color_vertices
from texproj.color.weights.surface import surface_view
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import PhotoInfo
from texproj.render import open_renderer

VIEWS = ((0.3, 0.2, 3.0), (-0.9, 0.4, 2.8), (0.8, -0.7, 2.6), (-0.2, -0.9, 3.1))
GAINS = np.array([[1, 1, 1], [0.5, 0.5, 0.5], [1.3, 1.2, 0.9], [0.8, 0.7, 0.95], [2, 2, 2]])
WIDTH, HEIGHT = 400, 300
HALF = np.hypot(WIDTH, HEIGHT) / 2


@pytest.fixture(scope="module")
def cpu():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


def shot(ev=None, body="a camera", size=(WIDTH, HEIGHT), focal=350.0):
    k = Intrinsics(*size, focal, focal, size[0] / 2, size[1] / 2)
    info = PhotoInfo("p.jpg", *size, camera_body=body, exposure_ev=ev)
    return Shot(Camera(k, Pose.identity()), info)


def loss_at(xy, corner):
    """A lens that keeps 1 - corner of its light in the corners, after the photos' own model."""
    squared = ((xy - (WIDTH / 2, HEIGHT / 2)) ** 2).sum(axis=1) / HALF**2
    return (1 + ((1 - corner) ** -0.5 - 1) * squared) ** -2


def shared_by(sees, gains, noise=0.0, corner=0.0, evs=None, still=False, seed=0):
    """sees: (p, n) bool; gains: (p, 3) light of each photo; noise: of log light; corner: light lost
    there; still: each point at the same place in all photos.
    """
    rng = np.random.default_rng(seed)
    photo, point = np.nonzero(sees)
    color = rng.uniform(0.08, 0.2, (sees.shape[1], 3))
    xy = rng.uniform((0, 0), (WIDTH, HEIGHT), (len(photo), 2))
    if still:
        xy = rng.uniform((0, 0), (WIDTH, HEIGHT), (sees.shape[1], 2))[point]
    rgb = color[point] * np.asarray(gains)[photo] * loss_at(xy, corner)[:, None]
    rgb *= np.exp(noise * rng.standard_normal(rgb.shape))
    shots = tuple(map(shot, evs if evs is not None else [None] * len(sees)))
    return SharedPoints(
        shots, sees.shape[1], photo.astype(np.int32), point.astype(np.int32),
        rgb.astype(np.float32), np.ones(len(photo), np.float32), xy.astype(np.float32),
    )  # fmt: skip


def all_over(photos=5, points=2000, share=0.7, seed=1):
    return np.random.default_rng(seed).random((photos, points)) < share


def even(gains):
    """Gains that make photos of these gains agree, geometric mean 1."""
    gains = np.asarray(gains, float)
    return np.exp(np.log(gains).mean(axis=0)) / gains


def solved(shared, **options):
    return solve_photometry(shared, ColorOptions(**options))


def chain(photos=16, points=100, shared=50, rise=0.03):
    """Photos that each share some points with the next one only, where they differ by the same
    small log light more than their exposures: what a sheen does.
    """
    count = photos * (points - shared) + shared
    sees = np.zeros((photos, count), bool)
    for i in range(photos):
        sees[i, i * (points - shared) : i * (points - shared) + points] = True
    return sees, np.exp(rise * np.arange(photos))[:, None] * np.ones(3)


def test_gains_are_as_sure_as_the_noise_allows():
    """5 % noise on 1400 points: gains are off by more than nothing and less than five deviations,
    and the disagreement that is told is that of the noise.
    """
    found = solved(shared_by(all_over(), GAINS, noise=0.05)).gains
    error = np.abs(np.log(found.factor / even(GAINS)))
    expected = 0.05 / np.sqrt(1400)
    assert expected / 20 < error.max() < 5 * expected
    assert np.all((found.spread > 0.02) & (found.spread < 0.05))


def test_the_mean_brightness_stays():
    """The geometric mean of the gains is 1, each channel."""
    found = solved(shared_by(all_over(), GAINS)).gains.factor
    assert np.allclose(np.log(found).mean(axis=0), 0, atol=1e-6)


def test_something_in_front_does_not_count():
    """A third of what a photo shows is something twice as bright: its gain is off by < 1 %."""
    sees = all_over()
    data = shared_by(sees, GAINS, noise=0.02)
    wrong = (data.photo == 2) & (data.point < 660)
    data.rgb[wrong] = np.minimum(data.rgb[wrong] * 2, 0.9)
    found = solved(data).gains.factor
    assert 0.0001 < np.abs(found / even(GAINS) - 1).max() < 0.01


def test_vignetting_is_found_with_its_certainty():
    """A third of the light lost in the corners comes out within 1 % and within four of its own
    standard deviations, gains within .5 %, and it is corrected.
    """
    result = solved(shared_by(all_over(), GAINS, noise=0.03, corner=0.35))
    (lens,) = result.lenses
    true = float(loss_at(np.array([[WIDTH / 2 + lens.reach * HALF, HEIGHT / 2]]), 0.35)[0])
    off = abs(np.log(lens.corner / true))
    assert lens.corrected and lens.left < 0.9 and lens.reach > 0.9
    assert 1e-3 < lens.sigma < 0.02
    assert off < 0.01 and off < 4 * lens.sigma
    relative = result.gains.factor / even(GAINS)
    assert np.abs(relative / relative.mean() - 1).max() < 0.005


def test_corrections_keep_the_mean_brightness_with_vignetting():
    """Gains times the lens's correction of what the photos show are 1 in the geometric mean."""
    data = shared_by(all_over(), GAINS, corner=0.35)
    result = solved(data)
    total = np.log(result.gains.factor[data.photo, 0]) - np.log(loss_at(data.xy_px, 0.35))
    means = [total[data.photo == p].mean() for p in range(5)]
    assert abs(np.mean(means)) < 0.005


@pytest.mark.parametrize(
    ("corner", "still", "why"),
    [(0.0, False, "there is none"), (0.35, True, "it shows in no difference"),
     (-0.3, False, "no lens is brighter at the corners")],
)  # fmt: skip
def test_vignetting_that_cannot_be_is_left(corner, still, why):
    """No light is changed where a lens shows none, or where it cannot be told."""
    result = solved(
        shared_by(all_over(), GAINS, noise=0.03, corner=corner, still=still), vignetting="on"
    )
    assert not result.lenses[0].corrected, why
    assert all(c.light is None for c in result.corrections)
    assert np.abs(result.gains.factor / even(GAINS) - 1).max() < (0.01 if corner >= 0 else 0.05)


def test_vignetting_off_and_auto():
    """Off looks at no lens. Auto leaves a sure loss alone that explains little of the differences;
    "on" corrects it.
    """
    data = shared_by(all_over(), GAINS, noise=0.4, corner=0.35)
    assert solved(data, vignetting="off").lenses == ()
    auto, on = solved(data).lenses[0], solved(data, vignetting="on").lenses[0]
    assert auto.left > 0.95 and not auto.corrected
    true = float(loss_at(np.array([[WIDTH / 2 + on.reach * HALF, HEIGHT / 2]]), 0.35)[0])
    assert on.corrected and abs(np.log(on.corner / true)) < 4 * on.sigma < 0.2


def test_lenses_are_told_apart():
    """Upright and lying photos of a body share a lens; another body, size or focal length does not,
    and two photos are too few to be looked at.
    """
    same = [shot(focal=350.0), shot(size=(HEIGHT, WIDTH), focal=355.0), shot(focal=346.0)]
    other = [shot(body="b"), shot(body="b"), shot(focal=500.0), shot(size=(800, 600)), None]
    assert lenses_of([*same, *other]).tolist() == [0, 0, 0, -1, -1, -1, -1, -1]


def alone(evs, gains=GAINS):
    """Four photos that overlap, and one that shares nothing."""
    sees = np.zeros((5, 2500), bool)
    sees[:4, :2000] = all_over(4)
    sees[4, 2000:] = True
    return shared_by(sees, gains, noise=0.02, evs=evs)


GRAY = np.array([1, 0.5, 1.5, 0.8, 2.0])[:, None] * np.ones(3)
HONEST = np.log2(GRAY[:, 0]) - 9


def test_exif_gives_the_exposure_of_a_photo_that_shares_nothing():
    """By EXIF it is right within 2 %; without, it stays as it is, a stop off."""
    known = solved(alone(HONEST, GRAY)).gains.factor
    assert np.abs(known / even(GRAY) - 1).max() < 0.02
    unknown = solved(alone(None, GRAY)).gains.factor
    assert np.allclose(unknown[4], 1, atol=0.01)


def test_a_lying_exif_does_not_win():
    """One photo's EXIF is two stops off: the gains are within 1 %, and the lie is told."""
    evs = HONEST + np.array([0, 2, 0, 0, 0])
    result = solved(alone(evs, GRAY))
    found = result.gains.factor[:4] / even(GRAY[:4])
    assert np.abs(found / found.mean() - 1).max() < 0.01
    assert result.exposure_off[1] == pytest.approx(2, abs=0.1)
    assert np.abs(result.exposure_off[[0, 2, 3, 4]]).max() < 0.1


def test_exif_that_is_wrong_all_over_is_hardly_used():
    """Exposures that a converter has evened out: the photo that shares nothing follows EXIF by
    less than half, where honest exposures would decide.
    """
    evs = np.array([-1.5, 1.0, -0.5, 2.0, 3.0])
    flat = solved(alone(evs, np.ones((5, 3)))).gains.factor
    assert np.abs(flat[:4] / flat[:4].mean() - 1).max() < 0.02
    assert -0.5 * (3.0 - 0.25) < np.log2(flat[4] / flat[:4].mean()).mean() < 0


def test_exif_holds_a_chain():
    """Photos that each overlap the next one only, where a sheen makes each 3 % brighter: without
    EXIF the gains drift by 15 x 3 %, with equal exposures told by less than a third of it.
    """
    sees, sheen = chain()

    def drift(evs):
        log_gain = np.log(solved(shared_by(sees, sheen, evs=evs)).gains.factor).mean(axis=1)
        return abs(log_gain[-1] - log_gain[0])

    assert 0.35 < drift(None) < 0.46
    assert 0.01 < drift(np.full(16, -9.0)) < 0.15


def test_gains_off_leaves_the_photos_alone():
    """Every factor is 1 and nothing else is corrected."""
    result = solved(shared_by(all_over(), GAINS, corner=0.35), gains=False)
    assert np.all(result.gains.factor == 1) and result.lenses == ()


def colored(views, photos, renderer, **options):
    return color_vertices(plane(), photo_set(views, photos), renderer, ColorOptions(**options))


def vignetted(view, corner, gain=1.0):
    photo = picture(view, gain=gain)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    k = view.intrinsics
    squared = ((x - k.cx) ** 2 + (y - k.cy) ** 2) / (np.hypot(*SIZE) / 2) ** 2
    light = (1 + ((1 - corner) ** -0.5 - 1) * squared) ** -2
    return replace(photo, pixels=(photo.pixels * light[..., None]).astype(np.float32))


@pytest.mark.parametrize("dist", [(0.0,) * 5, (-0.2, 0.05, 0.001, 0, 0)])
def test_the_surface_gets_its_even_light_back(cpu, dist):
    """Vignetted photos of a plane: relative colors are within 1.5 % with the correction and off by
    4 % or more without; also through a bent lens.
    """
    views = [camera(c, focal=180.0, dist=dist) for c in VIEWS]
    photos = [vignetted(view, 0.4) for view in views]
    mesh = plane()

    def spread(**options):
        result = colored(views, photos, cpu, **options)
        truth = pattern(mesh.vertices[:, 0], mesh.vertices[:, 1])
        inner = np.abs(mesh.vertices).max(axis=1) < 0.9  # the rim is a silhouette, hardly trusted
        relative = (result.rgb / truth)[inner & (result.photo_count > 1)]
        return np.abs(relative / np.median(relative) - 1).max(), result

    flat, result = spread()
    assert result.quality["lenses"][0]["corrected"]
    assert flat < 0.015
    assert 0.04 < spread(vignetting="off")[0] < 0.4


def test_a_clipped_photo_does_not_bleach(cpu):
    """One photo of four a stop over, three quarters of it clipped: its gain is within 1 % and the
    colors within 4 %, where a plain mean that trusts it is off by more than 5 %.
    """
    views = [camera(c) for c in VIEWS]
    photos = [picture(view) for view in views]
    over = np.minimum(photos[1].pixels * 2, 1)
    assert 0.6 < (over == 1).any(axis=2).mean() < 0.9
    photos[1] = replace(photos[1], pixels=over)
    result = colored(views, photos, cpu)
    gains = np.array([p["gain"] for p in result.quality["photos"]])
    assert np.abs(gains / even(np.array([[1], [2], [1], [1]])) - 1).max() < 0.01
    mesh = plane()
    truth = pattern(mesh.vertices[:, 0], mesh.vertices[:, 1]) * gains[0]
    sure = result.photo_count > 2
    assert np.abs(result.rgb / truth - 1)[sure].max() < 0.04
    plain = colored(views, photos, cpu, blend="mean", clipped_weight=1.0)
    assert np.abs(plain.rgb / truth - 1)[sure].max() > 0.05


def test_light_above_white_is_kept(cpu):
    """What only the darkest photo resolves, and the brightness of the whole puts above 1, is told
    as it is, in floating point.
    """
    views, bright = [camera(c) for c in VIEWS], np.float32(3)
    photos = [picture(view) for view in views]
    for i in range(3):
        over = photos[i].pixels * bright
        mask = np.where((over < 0.9).all(axis=2), 255, 0).astype(np.uint8)
        photos[i] = replace(photos[i], pixels=np.minimum(over, 1), mask=mask)
    result, mesh = colored(views, photos, cpu), plane()
    truth = pattern(mesh.vertices[:, 0], mesh.vertices[:, 1]) * bright**0.75
    once = (result.photo_count == 1) & (truth.max(axis=1) > 1.05)
    assert once.sum() > 100
    assert np.abs(result.rgb / truth - 1)[once].max() < 0.02


def stack_of(photos, points):
    shape = (len(photos), points)
    return Stack(
        np.array(photos, np.intp),
        np.ones((shape[0], 3, points), np.float32),
        np.ones(shape, np.float32),
    )


@pytest.mark.parametrize("dist", [(0.0,) * 5, (-0.2, 0.05, 0.001, 0, 0)])
def test_grids_are_looked_up_through_the_lens(dist):
    """A ramp over the picture comes out as each point's column, through a bent lens too."""
    points, view = VertexPoints.of(plane(half=0.6)), camera(VIEWS[0], dist=dist)
    ramp = ((np.arange(64) + 0.5) / 64)[None].repeat(48, 0).astype(np.float32)
    grid = grid_of(view, Correction(light=ramp))
    light = factors_at(points.chunk(0), points.owners.origin, grid)[:, 0]
    xy, _ = view.project(points.chunk(0).xyz + points.owners.origin)
    assert np.abs(light - xy[:, 0] / SIZE[0]).max() < 0.002


def test_photos_without_grids_are_left_alone():
    """The very same samples come back; with a grid only its photo's light and trust change."""
    points, view = VertexPoints.of(plane()), camera(VIEWS[0])
    stack = stack_of([0, 2], points.sizes[0])
    none = [Correction()] * 3
    assert corrected(stack, points, 0, grids_of([view] * 3, none)) is stack
    half = np.full((4, 5), 0.5, np.float32)
    some = [*none[:2], Correction(light=2 * np.ones((3, 3), np.float32), trust=half)]
    out = corrected(stack, points, 0, grids_of([view] * 3, some))
    assert np.array_equal(out.rgb[0], stack.rgb[0]) and np.all(out.rgb[1] == 2)
    assert np.all(out.weight[0] == 1) and np.all(out.weight[1] == 0.5)
    assert np.all(stack.rgb == 1)


def surveyed(renderer, views, **sizes):
    points, options = VertexPoints.of(plane(60)), ColorOptions()
    with renderer.load(plane(60)) as scene:
        observer = PointObserver(points, len(views) + 1)
        for number, view in enumerate(views):
            ready = photo_view(picture(view), view, scene, options)
            surface = surface_view(
                points.owners, view, ready.depth_camera, len(ready.levels), options
            )
            observer.add(number, surface, ready)
    return points, observer.shared()


def test_a_survey_knows_who_saw_what_where(cpu):
    """Each observation has the photo's own color, at the place where the camera sees the point."""
    views = [camera(c, dist=(-0.1, 0.02, 0.001, 0, 0)) for c in VIEWS]
    points, shared = surveyed(cpu, views)
    assert shared.shots[4] is None and shared.points == 61 * 61
    for number, view in enumerate(views):
        mine = shared.photo == number
        xyz = (points.owners.center + points.owners.origin)[shared.point[mine]]
        xy, _ = view.project(xyz)
        assert mine.sum() > 2000
        assert np.abs(xy - shared.xy_px[mine]).max() < 0.06  # the lens by its table
        assert np.abs(shared.rgb[mine] - pattern(*xyz.T[:2])).max() < 0.004


def test_a_survey_stays_small_whatever_the_number_of_photos(cpu, monkeypatch):
    """With a limit below what four photos see, the same fewer points are kept of all photos."""
    views = [camera(c) for c in VIEWS]
    _, full = surveyed(cpu, views)
    monkeypatch.setattr(shared_points_module, "MOST_OBSERVATIONS", 4000)
    _, shared = surveyed(cpu, views)
    assert 2000 < len(shared.photo) <= 4000 < len(full.photo)
    step = 4
    kept = full.point % step == 0
    assert np.array_equal(shared.point, full.point[kept])
    assert np.array_equal(shared.rgb, full.rgb[kept])
