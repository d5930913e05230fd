"""Registration by picks: found, uncertain, or refused with a sentence that says what to add."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import RegistrationError, UsageError
from texproj.options import PointsOptions, options_from
from texproj.photo import Correspondences, PhotoInfo
from texproj.register.picks.register import register_points

W, H = 3000, 2000
FAR_OFF, UP = np.array([4e5, 5e6, 100]), np.array([0, 0, 1.0])
INFO = PhotoInfo("0007.jpg", W, H)
LENS = Intrinsics(W, H, 2600, 2600, 1500, 1000)


def pinhole(xyz, R, t, f=2600.0, center=(1500.0, 1000.0), k1=0.0):
    """Written out here, so that the tests do not lean on the code under test."""
    x = xyz @ R.T + t
    xy = x[:, :2] / x[:, 2:]
    return xy * (1 + k1 * (xy**2).sum(axis=1, keepdims=True)) * f + center


class Scene:
    """A box of points seen from a random side."""

    def __init__(self, seed, n=16, sigma=1.5, flat=1.0, **lens):
        rng = np.random.default_rng(seed)
        self.rng, self.n, self.lens = rng, n, lens
        turn = Rotation.from_euler("zyx", rng.uniform([-0.1, -0.6, -0.4], [0.1, 0.6, 0.4]))
        self.R = turn.as_matrix()
        self.t = np.array([*rng.uniform(-0.1, 0.1, 2), 3.2]) * lens.get("f", 2600.0) / 2600
        self.surface = rng.uniform([-1, -0.7, -0.7 * flat], [1, 0.7, 0.7 * flat], (4000, 3))
        uv = self.project(self.surface)
        self.surface = self.surface[((uv > 0) & (uv < (W, H))).all(axis=1)]
        chosen = rng.choice(len(self.surface), n, replace=False)
        self.xyz = self.surface[chosen]
        self.xy = self.project(self.xyz) + rng.normal(0, sigma, (n, 2))

    def project(self, xyz):
        return pinhole(xyz, self.R, self.t, **self.lens)

    def spoil(self, count):
        """Give the first `count` picks another point's position, or a place anywhere."""
        for i in range(count):
            if i % 2:
                self.xyz[i] = self.surface[self.rng.integers(len(self.surface))]
            else:
                self.xy[i] = self.rng.uniform((0, 0), (W, H))
        return self

    @property
    def picks(self):
        names = tuple(f"p{i:02d}" for i in range(len(self.xy)))
        return Correspondences(np.clip(self.xy, 0, (W, H)), self.xyz, names)

    def error_px(self, camera):
        """Root mean square displacement over the surface."""
        moved = camera.project(self.surface)[0] - self.project(self.surface)
        return float(np.sqrt((moved**2).sum(axis=1).mean()))

    def register(self, prior=LENS, info=INFO, **options):
        return register_points(
            info, self.picks, prior, PointsOptions(**options), surface=self.surface
        )


def refusal(picks, prior=LENS, info=INFO, **keywords):
    with pytest.raises(RegistrationError) as caught:
        register_points(info, picks, prior, **keywords)
    text = str(caught.value)
    assert text.startswith("0007.jpg: ") and "\n" not in text
    return text


@pytest.fixture(scope="module")
def twelve():
    """As many scenes and what is found in each with a lens that is known."""
    return [(scene, scene.register()) for scene in map(Scene, range(12))]


def test_known_lens(twelve):
    """With the lens known 16 picks of 1.5 px give every camera to less than 3 px, none exactly."""
    errors = [scene.error_px(fit.camera) for scene, fit in twelve]
    assert 0.3 < np.median(errors) < 1.4
    assert max(errors) < 3


def test_exact_picks_give_the_exact_camera():
    """Without noise the camera is found to a thousandth of a pixel, also at map coordinates."""
    scene = Scene(0, sigma=0.0)
    far = replace(scene.picks, xyz_in_world=scene.xyz + FAR_OFF)
    fit = register_points(INFO, far, LENS)
    xy = fit.camera.project(scene.surface + FAR_OFF)[0]
    assert np.abs(xy - scene.project(scene.surface)).max() < 1e-2
    assert scene.error_px(scene.register().camera) < 1e-3


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_gross_outliers_are_named(share):
    """Spoiled picks are left out and named, and cost no more accuracy than their absence."""
    for seed in range(4):
        scene = Scene(seed, n=20)
        count = int(share * 20)
        good = scene.spoil(count)
        fit = good.register()
        off = np.linalg.norm(good.project(good.xyz) - good.picks.xy_px, axis=1) > 10
        wrong = [f"p{i:02d}" for i in np.flatnonzero(off)]
        assert fit.quality["outliers"] == wrong
        assert all(name in fit.reason for name in wrong)
        assert (fit.inliers == ~off).all() and (fit.residual_px[off] > 10).all()
        assert good.error_px(fit.camera) < 4


@pytest.mark.parametrize("factor", [1 / 1.2, 1.2])
@pytest.mark.parametrize("spoiled", [0, 4])
def test_wrong_known_focal_is_noticed_and_solved(factor, spoiled):
    """A trusted focal length 20 % off is overruled, by a sentence with both numbers."""
    for seed in range(4):
        scene = Scene(seed).spoil(spoiled)
        wrong = replace(LENS, fx=2600 * factor, fy=2600 * factor)
        fit = scene.register(wrong)
        assert fit.solved == ("rotation", "translation", "focal")
        assert abs(fit.camera.intrinsics.fx / 2600 - 1) < 0.03
        assert f"{wrong.fx:.0f} px" in fit.reason
        assert scene.error_px(fit.camera) < 5


def test_right_known_focal_is_kept(twelve):
    """A true focal length is hardly ever overruled: never in 12 cases."""
    fits = [fit for _, fit in twelve]
    assert all(fit.solved == ("rotation", "translation") for fit in fits)
    assert all(fit.camera.intrinsics == LENS for fit in fits)


def test_focal_known_is_obeyed():
    """`focal = known` keeps even a wrong focal length, or refuses; it never solves it."""
    scene = Scene(1)
    wrong = replace(LENS, fx=2610.0, fy=2610.0)
    fit = scene.register(wrong, focal="known")
    assert fit.camera.intrinsics == wrong
    assert "focal" not in fit.solved


@pytest.mark.parametrize("f", [1500.0, 2600.0, 9000.0])
def test_unknown_lens_is_solved(f):
    """Without cameras.json and EXIF wide lenses and long ones are found."""
    for seed in range(3):
        scene = Scene(seed, n=20, f=f)
        fit = scene.register(None)
        assert {"focal", "cx", "cy", "k1"} <= set(fit.solved)
        assert scene.error_px(fit.camera) < max(6, 3 * fit.expected_error_px)
        assert fit.expected_error_px < 9


def test_exif_focal_is_approximate():
    """A focal length from EXIF 4 % off is corrected; it narrows what is left open."""
    scene = Scene(2, n=14)
    approximate = scene.register(None, replace(INFO, focal_px=2700.0))
    unknown = scene.register(None)
    assert abs(approximate.camera.intrinsics.fx / 2600 - 1) < 0.03
    sigma = [fit.quality["focal_sigma_percent"] for fit in (approximate, unknown)]
    assert 0 < sigma[0] <= sigma[1]


def test_unexpected_distortion_is_solved():
    """A lens given as free of distortion that bends corners by 40 px is found out."""
    scene = Scene(3, n=24, sigma=1.0, k1=-0.08)
    fit = scene.register()
    assert "k1" in fit.solved
    assert fit.camera.intrinsics.dist[0] == pytest.approx(-0.08, abs=0.03)
    assert scene.error_px(fit.camera) < 5


def test_given_distortion_stays():
    """Known coefficients of any length are used and returned unchanged."""
    scene = Scene(4, k1=-0.08)
    lens = replace(LENS, dist=(-0.08, 0, 0, 0, 0, 0, 0, 0))
    fit = scene.register(lens)
    assert fit.camera.intrinsics == lens
    assert scene.error_px(fit.camera) < 3


def test_solve_list_is_obeyed():
    """What is listed is solved, and nothing else."""
    scene = Scene(5, n=24)
    fit = scene.register(solve=("focal", "k2"))
    assert fit.solved == ("rotation", "translation", "focal", "k1", "k2")
    assert fit.covariance.shape == (9, 9)
    assert scene.register(solve=("pose",)).solved == ("rotation", "translation")
    assert scene.register(solve=("principal-point",)).solved[2:] == ("cx", "cy")


def test_prior_of_a_resized_photo_is_scaled():
    """Intrinsics for a half-size version of the photo are used at full size."""
    scene = Scene(6)
    assert scene.register(LENS.scaled(0.5)).camera.intrinsics.fx == pytest.approx(2600)


@pytest.mark.parametrize(
    ("n", "sigma", "spoiled"),
    [(5, 1.5, 0), (8, 1.0, 1), (16, 0.5, 0), (16, 5.0, 4), (30, 2.0, 15)],
)
def test_expected_error_is_honest(n, sigma, spoiled):
    """Over 20 cases the true error is, in the root mean square, .6 to 1.35 of what is expected,
    and never four times as large; refused cases do not count.
    """
    ratios = []
    for seed in range(20):
        scene = Scene(100 + seed, n=n, sigma=sigma).spoil(spoiled)
        try:
            fit = scene.register(focal="known")
        except RegistrationError:
            continue
        ratios.append(scene.error_px(fit.camera) / fit.expected_error_px)
    assert len(ratios) >= 15
    assert max(ratios) < 4
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.35


def test_expected_error_without_a_surface_covers_the_picked_box():
    """Without the mesh the expectation is of the same size, not that at the picks alone."""
    scene = Scene(7)
    alone = register_points(INFO, scene.picks, LENS).expected_error_px
    assert 0.5 < alone / scene.register().expected_error_px < 2.5


def test_residuals_belong_to_the_picks():
    """One residual and one name for each pick, in their order, of a size like the noise."""
    scene = Scene(8)
    fit = scene.register()
    offset = fit.camera.project(scene.xyz)[0] - scene.xy
    assert np.allclose(fit.residual_px, np.linalg.norm(offset, axis=1))
    assert fit.names == scene.picks.names
    assert 0.8 < fit.quality["pick_sigma_px"] < 2.5


def test_same_seed_same_camera():
    """Nothing depends on chance."""
    a, b = (Scene(9).spoil(6).register(None) for _ in range(2))
    assert (a.camera.pose.R == b.camera.pose.R).all() and a.camera.intrinsics == b.camera.intrinsics


@pytest.mark.parametrize("n", [0, 1, 3])
def test_too_few_picks(n):
    """Fewer than four picks are refused with their number, even with a start."""
    scene = Scene(0, n=max(n, 1))
    picks = Correspondences(scene.xy[:n], scene.xyz[:n])
    text = refusal(picks, start=Pose(scene.R, scene.t))
    assert f"{n} pick" in text and "pick 8 points" in text


def test_pick_outside_the_photo_is_named():
    """The name and the photo's size are told."""
    scene = Scene(0)
    scene.xy[3] = (3500, 20)
    picks = Correspondences(scene.xy, scene.xyz, scene.picks.names)
    text = refusal(picks)
    assert "p03" in text and "3500" in text and "3000 x 2000" in text


def test_pick_that_is_not_a_number_is_named():
    """Infinite coordinates do not reach the solver."""
    scene = Scene(0)
    scene.xyz[5, 1] = np.inf
    assert "p05" in refusal(scene.picks)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_line(noise):
    """Picks on one line are refused, with a place away from it."""
    scene = Scene(0)
    along = np.linspace(-0.8, 0.8, 6)[:, None]
    xyz = along * (1, -0.3, 0.2) + scene.rng.normal(0, noise, (6, 3))
    text = refusal(Correspondences(scene.project(xyz), xyz))
    assert "on one line" in text and "add at least one pick" in text
    assert any(side in text for side in ("upper left", "upper right", "lower left", "lower right"))


def test_line_seen_end_on():
    """Points of a plane that the camera sees edge-on lie on one line of the photo."""
    scene = Scene(0)
    edge = Pose(scene.R, scene.t).inverse.apply(
        np.c_[np.linspace(-0.6, 0.6, 8), np.zeros(8), scene.rng.uniform(2.5, 4, 8)]
    )
    assert "on one line" in refusal(Correspondences(scene.project(edge), edge))


def frontal_plane(f=2600.0, sigma=1.5):
    """Twelve picks on a wall seen almost head-on: distance and focal length trade freely."""
    scene = Scene(11, n=12, sigma=sigma, flat=0.0, f=f)
    scene.R = Rotation.from_euler("y", 0.05).as_matrix()
    scene.xy = scene.project(scene.xyz) + scene.rng.normal(0, sigma, (12, 2))
    return scene


def test_plane_without_focal():
    """One plane does not give the focal length: pick off the plane."""
    text = refusal(frontal_plane().picks, None)
    assert "plane" in text and "focal length" in text and "add" in text


def test_plane_with_focal():
    """With the focal length known one plane is enough for that plane."""
    scene = frontal_plane()
    fit = scene.register()
    assert scene.error_px(fit.camera) < 3


def test_plane_with_two_readings():
    """A small tilted plane far away has two mirrored readings: refused, not guessed."""
    rng = np.random.default_rng(3)
    xyz = np.c_[rng.uniform(-1, 1, (6, 2)), np.zeros(6)]
    R = Rotation.from_euler("xyz", [0.5, 0.1, 0.0]).as_matrix()
    xy = pinhole(xyz, R, np.array([0, 0, 200.0]), 1e5) + rng.normal(0, 1.5, (6, 2))
    lens = replace(LENS, fx=1e5, fy=1e5)
    relief = np.concatenate([xyz, xyz + UP, xyz - UP])
    text = refusal(Correspondences(xy, xyz), lens, surface=relief)
    assert "two different cameras" in text or "uncertain" in text


def test_corner():
    """Picks all in one corner are refused, with a place elsewhere."""
    scene = Scene(0)
    xyz = scene.surface
    xy = scene.project(xyz)
    near = np.argsort(np.linalg.norm(xy - xy.min(axis=0), axis=1))[:8]
    text = refusal(Correspondences(xy[near], xyz[near]), surface=xyz)
    assert "add picks" in text and ("right" in text or "lower" in text)


def test_chance_agreement():
    """Picks that belong to nothing are refused in every one of 6 cases."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        picks = Correspondences(rng.uniform((0, 0), (W, H), (10, 2)), rng.uniform(-1, 1, (10, 3)))
        told = refusal(picks)
        assert "check" in told or "uncertain" in told


def test_limit_is_the_users():
    """A lower limit on the expected error refuses what passed before, and says where to add."""
    scene = Scene(10)
    with pytest.raises(RegistrationError, match=r"uncertain by .* px .*add picks"):
        scene.register(max_error_percent=0.01)


def test_options_are_checked():
    """A misspelled value is an error that names the key."""
    with pytest.raises(UsageError, match="solve"):
        options_from(PointsOptions, {"solve": ["focus"]}, "project.toml")


def test_camera_is_usable_at_once():
    """The fit's camera is the full-size photo's."""
    camera = Scene(12).register().camera
    assert isinstance(camera, Camera) and (camera.width, camera.height) == (W, H)
